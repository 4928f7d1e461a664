"""The replay of a search mission: a canvas, a slider, and a script of our own; nothing is loaded."""

from __future__ import annotations

import json
from typing import Any

from swarmbid.report.search_scene import SearchScene
from swarmbid.report.svg import NUM_COLOURS
from swarmbid.sightings import ACCEPT, ANNOUNCE, BID

MOST_FRAMES = 600
MOST_EVENTS = 4000
_SPOKEN = {ANNOUNCE: 0, BID: 1, ACCEPT: 2}


def replay_data(scene: SearchScene) -> dict[str, Any]:
    """Return what the script draws: places at even times, and what was found and said.

    Coordinates are rounded to 0.1 m; a vehicle or target that is not there yet has null.
    """
    count = MOST_FRAMES if scene.end > 0.0 else 1
    times = [scene.end * frame / max(1, count - 1) for frame in range(count)]
    vehicles = list(scene.vehicles)
    radii = {str(one["id"]): one.get("radius") or 0.0 for one in scene.world.get("vehicles", ())}
    said = [
        [round(act.t, 1), vehicles.index(act.agent), vehicles.index(act.to) if act.to in vehicles else -1,
         _SPOKEN[act.performative], life.task]
        for life in scene.lives.values()
        for act in life.acts
        if act.performative in _SPOKEN and act.agent in scene.vehicles
    ]  # fmt: skip
    found = [
        [round(one.t, 1), vehicles.index(one.agent) if one.agent in scene.vehicles else -1,
         round(one.x, 1), round(one.y, 1), life.task, bool(one.truth)]
        for life in scene.lives.values()
        for one in life.detections[:1]
    ]  # fmt: skip
    return {
        "end": scene.end,
        "box": scene.box,
        "boundary": scene.boundary,
        "exclusions": scene.exclusions,
        "bases": scene.bases,
        "vehicles": [
            {
                "id": vehicle,
                "colour": scene.colours[vehicle] % NUM_COLOURS,
                "radius": radii.get(vehicle, 0.0),
                "crash": scene.crashes.get(vehicle),
                "places": [_rounded(line.at(t)) for t in times],
                "modes": [line.mode_at(t) for t in times],
            }
            for vehicle, line in scene.vehicles.items()
        ],
        "targets": [
            {"id": target, "places": [_rounded(line.at(t)) for t in times]}
            for target, line in scene.targets.items()
        ],
        "said": sorted(said)[:MOST_EVENTS],
        "found": sorted(found)[:MOST_EVENTS],
    }


def replay(scene: SearchScene) -> str:
    """Return the elements that the script fills."""
    data = json.dumps(replay_data(scene), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        '<div class="replay"><canvas id="replay" width="1120" height="700" role="img" '
        'aria-label="Replay of the mission"></canvas>\n'
        '<div class="controls"><button id="play" type="button">Play</button>'
        f'<input id="when" type="range" min="0" max="{scene.end:.1f}" step="any" value="0" '
        'aria-label="Time of the mission"><output id="clock"></output></div>\n'
        f'<p class="hint" id="now"></p></div>\n<script type="application/json" id="flown">{data}</script>'
    )


def _rounded(place: tuple[float, float] | None) -> list[float] | None:
    return None if place is None else [round(place[0], 1), round(place[1], 1)]


STYLE = """
.replay canvas{width:100%;height:auto;display:block;border-radius:8px}
.controls{display:flex;gap:12px;align-items:center;margin:10px 0 4px}
.controls input{flex:1;accent-color:var(--accent)}
.controls button{font:inherit;font-weight:600;padding:4px 16px;border-radius:8px;border:1px solid var(--line);
 background:var(--sheet);color:var(--ink);cursor:pointer;min-width:84px}
.controls output{font-weight:600;min-width:7ch;text-align:right}
@media print{.replay{display:none}}
"""

SCRIPT = """(() => {
const data = JSON.parse(document.getElementById("flown").textContent);
const canvas = document.getElementById("replay"), pen = canvas.getContext("2d");
const slider = document.getElementById("when"), button = document.getElementById("play");
const output = document.getElementById("clock"), now = document.getElementById("now");
const [west, south, east, north] = data.box;
const margin = 0.04 * Math.max(east - west, north - south, 1);
const across = Math.max(east - west, 1) + 2 * margin, along = Math.max(north - south, 1) + 2 * margin;
canvas.height = Math.round(Math.min(820, Math.max(360, 1120 * along / across)));
const scale = Math.min(canvas.width / across, canvas.height / along);
const left = (canvas.width - across * scale) / 2, top = (canvas.height - along * scale) / 2;
const px = x => left + (x - west + margin) * scale, py = y => top + (north + margin - y) * scale;
const frames = Math.max(...data.vehicles.concat(data.targets).map(one => one.places.length), 1);
function where(one, t) {
  const f = data.end > 0 ? t / data.end * (frames - 1) : 0, i = Math.min(Math.floor(f), frames - 1);
  const a = one.places[i], b = one.places[Math.min(i + 1, frames - 1)];
  return a && b ? [a[0] + (b[0] - a[0]) * (f - i), a[1] + (b[1] - a[1]) * (f - i), i] : null;
}
function polygon(points, fill, stroke) {
  pen.beginPath();
  points.forEach((p, i) => i ? pen.lineTo(px(p[0]), py(p[1])) : pen.moveTo(px(p[0]), py(p[1])));
  pen.closePath(); pen.fillStyle = fill; pen.fill(); pen.strokeStyle = stroke; pen.stroke();
}
function dot(x, y, r, fill) { pen.beginPath(); pen.arc(x, y, r, 0, 7); pen.fillStyle = fill; pen.fill(); }
function cross(x, y, ink) {
  pen.beginPath(); pen.moveTo(x - 6, y - 6); pen.lineTo(x + 6, y + 6); pen.moveTo(x + 6, y - 6);
  pen.lineTo(x - 6, y + 6); pen.strokeStyle = ink; pen.stroke();
}
const TOLD = ["asks for proposals for", "bids for", "awards"];
function draw() {
  const t = Number(slider.value), look = getComputedStyle(document.documentElement);
  const paint = name => look.getPropertyValue("--" + name).trim();
  pen.lineWidth = 1.5; pen.setLineDash([]); pen.globalAlpha = 1;
  pen.fillStyle = paint("bg"); pen.fillRect(0, 0, canvas.width, canvas.height);
  if (data.boundary.length) polygon(data.boundary, paint("sheet"), paint("soft"));
  for (const zone of data.exclusions) polygon(zone, paint("bad-bg"), paint("bad"));
  pen.fillStyle = paint("ink");
  for (const base of data.bases) pen.fillRect(px(base[0]) - 6, py(base[1]) - 6, 12, 12);
  pen.font = "600 15px sans-serif";
  for (const target of data.targets) {
    const p = where(target, t);
    if (!p) continue;
    const x = px(p[0]), y = py(p[1]);
    pen.beginPath(); pen.moveTo(x, y - 7); pen.lineTo(x + 7, y); pen.lineTo(x, y + 7); pen.lineTo(x - 7, y);
    pen.closePath(); pen.fillStyle = paint("ink"); pen.fill(); pen.fillText(target.id, x + 10, y + 16);
  }
  for (const [when, who, x, y, , real] of data.found) {
    if (when > t) continue;
    pen.beginPath(); pen.arc(px(x), py(y), 9, 0, 7);
    pen.strokeStyle = real && who >= 0 ? paint("a" + data.vehicles[who].colour) : paint("bad"); pen.stroke();
  }
  const places = data.vehicles.map(one => where(one, t));
  data.vehicles.forEach((one, v) => {
    const p = places[v], colour = paint("a" + one.colour);
    if (!p) return;
    const x = px(p[0]), y = py(p[1]);
    if (one.crash !== null && one.crash <= t) { cross(x, y, paint("bad")); return; }
    pen.strokeStyle = colour; pen.globalAlpha = .6; pen.beginPath();
    for (let i = Math.max(0, p[2] - 25); i <= p[2]; i++)
      if (one.places[i]) pen.lineTo(px(one.places[i][0]), py(one.places[i][1]));
    pen.lineTo(x, y); pen.stroke();
    pen.globalAlpha = .15; dot(x, y, one.radius * scale, colour); pen.globalAlpha = 1;
    dot(x, y, 7, colour);
    pen.fillStyle = paint("ink"); pen.fillText(one.id + " · " + one.modes[p[2]], x + 10, y - 9);
  });
  const lasting = Math.max(data.end / 150, 1);
  const told = [];
  for (const [when, from, to, what, task] of data.said) {
    if (when > t || when < t - lasting) continue;
    told.push(data.vehicles[from].id + " " + TOLD[what] + " " + task +
      (what === 2 && to >= 0 ? " to " + data.vehicles[to].id : ""));
    pen.strokeStyle = paint("a" + data.vehicles[from].colour);
    pen.lineWidth = what === 2 ? 4 : 2; pen.setLineDash(what === 0 ? [4, 6] : []);
    data.vehicles.forEach((one, v) => {
      if (v === from || (to >= 0 && v !== to) || !places[v] || !places[from]) return;
      pen.beginPath(); pen.moveTo(px(places[from][0]), py(places[from][1]));
      pen.lineTo(px(places[v][0]), py(places[v][1])); pen.stroke();
    });
  }
  const last = data.found.filter(one => one[0] <= t && one[0] > t - lasting * 2);
  for (const one of last)
    told.push((one[1] >= 0 ? data.vehicles[one[1]].id : "somebody") + " finds " + one[4]);
  const minutes = Math.floor(t / 60), rest = Math.floor(t % 60);
  output.textContent = minutes + ":" + String(rest).padStart(2, "0");
  now.textContent = [...new Set(told)].slice(0, 4).join("; ") || "\\u00a0";
}
let running = null, before = 0;
function step(stamp) {
  if (running === null) return;
  slider.value = Number(slider.value) + (stamp - before) / 1000 * data.end / 60;
  before = stamp; draw();
  if (Number(slider.value) >= data.end) stop(); else running = requestAnimationFrame(step);
}
function stop() {
  if (running !== null) cancelAnimationFrame(running);
  running = null; button.textContent = "Play";
}
button.addEventListener("click", () => {
  if (running !== null) { stop(); return; }
  if (Number(slider.value) >= data.end) slider.value = 0;
  button.textContent = "Pause"; before = performance.now(); running = requestAnimationFrame(step);
});
slider.addEventListener("input", () => { draw(); });
const asked = /^#t=([0-9.]+)$/.exec(location.hash);
if (asked) slider.value = Number(asked[1]);
draw();
})();"""
