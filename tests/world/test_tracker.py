"""The tracker against filterpy, its own statistics, and cases by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmbid.rng import stream
from swarmbid.world.tracker import Track, Tracker, gospa, intersect


def test_equals_filterpy():
    from filterpy.common import Q_continuous_white_noise
    from filterpy.kalman import KalmanFilter

    rng = stream(1, "filter")
    oracle = KalmanFilter(4, 2)
    oracle.x, oracle.P = np.array([[1.0, 2.0, 3.0, 4.0]]).T, np.diag([9.0, 9.0, 25.0, 25.0])
    oracle.H, oracle.R = np.eye(2, 4), np.eye(2) * 9.0
    track = Track(oracle.x[:, 0].copy(), oracle.P.copy(), 0.0)
    t = 0.0
    for dt in rng.uniform(0.1, 3.0, 50):
        t += dt
        oracle.F = np.eye(4) + dt * np.eye(4, k=2)
        noise = Q_continuous_white_noise(2, dt, 0.3)  # per axis (position, velocity)
        oracle.Q = np.kron(noise, np.eye(2))
        oracle.predict()
        z = rng.normal(0.0, 20.0, 2)
        oracle.update(z)
        track.predict(t, 0.3)
        track.update(float(z[0]), float(z[1]), 3.0)
        np.testing.assert_allclose(track.mean, oracle.x[:, 0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(track.covariance, oracle.P, rtol=1e-9, atol=1e-9)


def test_nees_is_inside_its_band():
    rng, runs, noise = stream(2, "nees"), 400, 0.5
    root = np.linalg.cholesky(noise * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]))
    total = 0.0
    for _ in range(runs):
        truth = np.array([0.0, 0.0, *rng.normal(0.0, 10.0, 2)])
        place = truth[:2] + rng.normal(0.0, 5.0, 2)
        track = Track(np.array([*place, 0.0, 0.0]), np.diag([25.0, 25.0, 100.0, 100.0]), 0.0)
        for t in range(1, 21):
            truth[:2] += truth[2:]
            kick = root @ rng.normal(size=(2, 2))
            truth += kick.ravel()
            track.predict(float(t), noise)
            z = truth[:2] + rng.normal(0.0, 5.0, 2)
            track.update(float(z[0]), float(z[1]), 5.0)
        error = track.mean - truth
        total += error @ np.linalg.solve(track.covariance, error)
    # mean of chi-square with 4 degrees of freedom: 4, standard deviation sqrt(8 / runs)
    assert abs(total / runs - 4.0) < 3.0 * math.sqrt(8.0 / runs)


def test_confirmation_deletion_and_crossing_targets():
    tracker = Tracker(confirm=(2, 3), delete=3)
    tracker.look(0.0, np.array([[0.0, 0.0], [100.0, 0.0]]))
    assert [track.confirmed for track in tracker.tracks] == [False, False]
    tracker.look(1.0, np.array([[101.0, 0.0], [1.0, 0.0]]))
    assert [round(float(track.mean[0])) for track in tracker.tracks] == [1, 101]
    assert all(track.confirmed for track in tracker.tracks)
    for t in (2.0, 3.0):
        tracker.look(t, np.empty((0, 2)), seen=[False, True])
    assert [track.misses for track in tracker.tracks] == [0, 2]
    tracker.look(4.0, np.empty((0, 2)), seen=[False, True])
    assert [track.number for track in tracker.tracks] == [0]


def test_moving_takes_evidence():
    rng = stream(3, "speed")
    for speed, expected in ((0.0, False), (6.0, True)):
        tracker = Tracker(noise=1e-4, sigma=3.0)
        for t in range(60):
            tracker.look(float(t), np.array([[speed * t, 0.0]]) + rng.normal(0.0, 3.0, (1, 2)))
            if t == 0:
                assert tracker.tracks[0].moves() is None
        assert tracker.tracks[0].moves() is expected


def test_intersection_is_consistent_and_idempotent():
    a, b = np.diag([1.0, 100.0, 1.0, 1.0]), np.diag([100.0, 1.0, 1.0, 1.0])
    mean, same = intersect(np.ones(4), a, np.ones(4), a)
    assert mean == pytest.approx(np.ones(4)) and same == pytest.approx(a)
    # by hand: w = 1/2 gives 2 / (1 + 1/100) = 1.980 on both axes
    _, fused = intersect(np.zeros(4), a, np.zeros(4), b)
    assert np.diag(fused) == pytest.approx([200 / 101, 200 / 101, 1.0, 1.0])


def test_gospa_by_hand():
    truth = np.array([[0.0, 0.0], [100.0, 0.0]])
    assert gospa(truth, truth[::-1], 10.0) == 0.0
    assert gospa(truth, np.array([[3.0, 4.0]]), 10.0) == pytest.approx(math.sqrt(25 + 50))
    assert gospa(truth, np.array([[0.0, 50.0], [100.0, 0.0]]), 10.0) == pytest.approx(10.0)
    assert gospa(np.empty((0, 2)), truth, 10.0) == pytest.approx(10.0)
