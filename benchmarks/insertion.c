/* The insertion evaluation of swarmbid/kernels/insertion.py as a C compiler vectorises it: the limit to
 * compare with. Every task at every position of a path, the suffix re-timed, tasks as lanes in blocks.
 *
 * Freer than the kernel it measures: -ffast-math lets the compiler fuse and reorder, so its last bits
 * depend on the machine, which a bid must not. NOWHERE stands for minus infinity, which -ffast-math
 * assumes away.
 *
 * Built twice: as it is, with the whole family of scores; and with -DDECAY_ONLY, in which a visit is
 * worth reward * exp(-decay * (t - reference)) and nothing else, so that the price of one family for
 * all scores is seen too.
 */
#include <math.h>
#include <stdint.h>

enum { BLOCK = 256 };
enum { X, Y, Z, END, READY, OPEN, DURATION, REWARD, REFERENCE, DECAY, PEAK, INVERSE_WIDTH };
enum { AGENT_X, AGENT_Y, AGENT_Z, SLOWNESS, AVAILABLE, COST_PER_METRE, RANGE, LATEST_RETURN, HAS_BASE, BASE_X,
       BASE_Y, BASE_Z, DISTANCE_STEP };
enum { HOLD, SHIFT };
#define NOWHERE (-1e300)

static void distances(double x, double y, double z, const double *restrict xs, const double *restrict ys,
                      const double *restrict zs, int64_t count, double step, double *restrict out)
{
#pragma omp simd
    for (int64_t j = 0; j < count; j++) {
        double dx = xs[j] - x, dy = ys[j] - y, dz = zs[j] - z;
        out[j] = sqrt(dx * dx + dy * dy + dz * dz);
    }
    if (step > 0.0) {
#pragma omp simd
        for (int64_t j = 0; j < count; j++)
            out[j] = floor(out[j] / step + 1e-9) * step;
    }
}

static inline double worth(double start, double reward, double reference, double decay, double peak,
                           double inverse_width)
{
#ifdef DECAY_ONLY
    return reward * exp(-decay * (start - reference));
#else
    double off = (start - peak) * inverse_width;
    return reward * exp(-(decay * (start - reference) + off * off));
#endif
}

static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }

__attribute__((noinline)) void evaluate(
    const double *restrict tasks, int64_t num_tasks, const double *restrict agent, const int64_t *restrict path,
    int64_t length, const double *restrict starts, const double *restrict legs, const double *restrict values,
    double total, int64_t rule, double *restrict gain, int64_t *restrict position, double *restrict start_time)
{
    const double slowness = agent[SLOWNESS], cost = agent[COST_PER_METRE], step = agent[DISTANCE_STEP];
    double leg_in[BLOCK] __attribute__((aligned(64))), leg_out[BLOCK] __attribute__((aligned(64)));
    double home[BLOCK] __attribute__((aligned(64))), time[BLOCK] __attribute__((aligned(64)));
    double free_at[BLOCK] __attribute__((aligned(64))), score[BLOCK] __attribute__((aligned(64)));
#define ROW(name) (tasks + (name)*num_tasks)

    for (int64_t first = 0; first < num_tasks; first += BLOCK) {
        int64_t count = num_tasks - first < BLOCK ? num_tasks - first : BLOCK;
        const double *restrict xs = ROW(X) + first, *restrict ys = ROW(Y) + first, *restrict zs = ROW(Z) + first;
        const double *restrict end = ROW(END) + first, *restrict ready = ROW(READY) + first;
        const double *restrict open = ROW(OPEN) + first, *restrict duration = ROW(DURATION) + first;
        const double *restrict reward = ROW(REWARD) + first, *restrict reference = ROW(REFERENCE) + first;
        const double *restrict decay = ROW(DECAY) + first, *restrict peak = ROW(PEAK) + first;
        const double *restrict inverse_width = ROW(INVERSE_WIDTH) + first;
        double *restrict best = gain + first, *restrict best_time = start_time + first;
        int64_t *restrict place = position + first;

#pragma omp simd
        for (int64_t j = 0; j < count; j++) {
            best[j] = NOWHERE;
            place[j] = 0;
            best_time[j] = 0.0;
            home[j] = 0.0;
        }
        if (agent[HAS_BASE] > 0.0)
            distances(agent[BASE_X], agent[BASE_Y], agent[BASE_Z], xs, ys, zs, count, step, home);

        for (int64_t n = 0; n <= length; n++) {
            double departure;
            if (n == 0) {
                departure = agent[AVAILABLE];
                distances(agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z], xs, ys, zs, count, step, leg_in);
            } else {
                departure = starts[n - 1] + ROW(DURATION)[path[n - 1]];
#pragma omp simd
                for (int64_t j = 0; j < count; j++)
                    leg_in[j] = leg_out[j];
            }
            if (n < length) {
                int64_t after = path[n];
                distances(ROW(X)[after], ROW(Y)[after], ROW(Z)[after], xs, ys, zs, count, step, leg_out);
            }

            if (rule == HOLD) {
                int held = n < length;
                double promised = held ? starts[n] : 0.0, old_leg = held ? legs[n] : 0.0;
#pragma omp simd
                for (int64_t j = 0; j < count; j++) {
                    double earliest = larger(departure + leg_in[j] * slowness, open[j]);
                    double latest = end[j];
                    if (held)
                        latest = smaller(latest, promised - duration[j] - leg_out[j] * slowness);
                    double t = larger(earliest, smaller(ready[j], latest));
                    double s = worth(t, reward[j], reference[j], decay[j], peak[j], inverse_width[j])
                               - cost * leg_in[j];
                    if (held)
                        s -= cost * (leg_out[j] - old_leg);
                    time[j] = t;
                    free_at[j] = t + duration[j];
                    score[j] = earliest <= latest ? s : NOWHERE;
                }
            } else {
#pragma omp simd
                for (int64_t j = 0; j < count; j++) {
                    double t = larger(departure + leg_in[j] * slowness, ready[j]);
                    double s = worth(t, reward[j], reference[j], decay[j], peak[j], inverse_width[j])
                               - cost * leg_in[j];
                    time[j] = t;
                    free_at[j] = t + duration[j];
                    score[j] = t <= end[j] ? s : NOWHERE;
                }
                for (int64_t k = n; k < length; k++) {
                    int64_t task = path[k];
                    double ready_k = ROW(READY)[task], end_k = ROW(END)[task], duration_k = ROW(DURATION)[task];
                    double reward_k = ROW(REWARD)[task], reference_k = ROW(REFERENCE)[task];
                    double decay_k = ROW(DECAY)[task], peak_k = ROW(PEAK)[task];
                    double inverse_width_k = ROW(INVERSE_WIDTH)[task];
                    double lost = values[k], leg_k = legs[k];
                    if (k == n) {
#pragma omp simd
                        for (int64_t j = 0; j < count; j++) {
                            double later = larger(free_at[j] + leg_out[j] * slowness, ready_k);
                            double s = score[j] - cost * leg_out[j] - lost
                                       + worth(later, reward_k, reference_k, decay_k, peak_k, inverse_width_k);
                            free_at[j] = later + duration_k;
                            score[j] = later <= end_k ? s : NOWHERE;
                        }
                    } else {
                        double travel = leg_k * slowness, gone = cost * leg_k + lost;
#pragma omp simd
                        for (int64_t j = 0; j < count; j++) {
                            double later = larger(free_at[j] + travel, ready_k);
                            double s = score[j] - gone
                                       + worth(later, reward_k, reference_k, decay_k, peak_k, inverse_width_k);
                            free_at[j] = later + duration_k;
                            score[j] = later <= end_k ? s : NOWHERE;
                        }
                    }
                }
            }

            if (n < length) {
                int64_t final = path[length - 1];
                double back = 0.0;
                if (agent[HAS_BASE] > 0.0)
                    distances(agent[BASE_X], agent[BASE_Y], agent[BASE_Z], &ROW(X)[final], &ROW(Y)[final],
                              &ROW(Z)[final], 1, step, &back);
                double kept = starts[length - 1] + ROW(DURATION)[final];
                double flown = total - legs[n] + back, way_back = back * slowness;
#pragma omp simd
                for (int64_t j = 0; j < count; j++) {
                    double done = (rule == HOLD ? kept : free_at[j]) + way_back;
                    int fits = (flown + leg_in[j] + leg_out[j] <= agent[RANGE]) & (done <= agent[LATEST_RETURN]);
                    int better = fits & (score[j] > best[j]);
                    best[j] = better ? score[j] : best[j];
                    place[j] = better ? n : place[j];
                    best_time[j] = better ? time[j] : best_time[j];
                }
            } else {
#pragma omp simd
                for (int64_t j = 0; j < count; j++) {
                    double done = free_at[j] + home[j] * slowness;
                    int fits = (total + leg_in[j] + home[j] <= agent[RANGE]) & (done <= agent[LATEST_RETURN]);
                    int better = fits & (score[j] > best[j]);
                    best[j] = better ? score[j] : best[j];
                    place[j] = better ? n : place[j];
                    best_time[j] = better ? time[j] : best_time[j];
                }
            }
        }
    }
}

void repeat_evaluate(
    int64_t repeats, const double *tasks, int64_t num_tasks, const double *agent, const int64_t *path, int64_t length,
    const double *starts, const double *legs, const double *values, double total, int64_t rule, double *gain,
    int64_t *position, double *start_time)
{
    for (int64_t r = 0; r < repeats; r++)
        evaluate(tasks, num_tasks, agent, path, length, starts, legs, values, total, rule, gain, position, start_time);
}
