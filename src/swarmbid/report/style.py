"""How the page looks and the little that it does: CSS and a script of twenty lines, as text.

The page is one file and loads nothing. Colours stand in custom properties, so that light, dark and
print need only other values.
"""

from __future__ import annotations

import base64
import hashlib

from swarmbid.report.svg import DARK_COLOURS, LIGHT_COLOURS

_FONT = 'Inter,"Segoe UI",Roboto,"Helvetica Neue","Liberation Sans",Arial,sans-serif'


def _palette(colours: tuple[str, ...]) -> str:
    return "".join(f"--a{i}:{colour};" for i, colour in enumerate(colours))


_LIGHT = (
    "--bg:#f4f6f8;--card:#fff;--sheet:#fbfcfd;--ink:#17212b;--soft:#5a6775;--line:#e1e6eb;--grid:#edf0f3;"
    "--accent:#0b63b0;--good:#137a4b;--good-bg:#e3f4ea;--bad:#b3261e;--bad-bg:#fbe9e7;--warn:#8a5a00;"
    "--warn-bg:#fdf1d8;" + _palette(LIGHT_COLOURS)
)
_DARK = (
    "--bg:#0e1318;--card:#161d25;--sheet:#131a21;--ink:#e4eaf0;--soft:#98a5b3;--line:#2a3541;--grid:#1e2730;"
    "--accent:#6cb2f0;--good:#5fd39a;--good-bg:#12301f;--bad:#ff8a80;--bad-bg:#3a1815;--warn:#f0c060;"
    "--warn-bg:#35280c;" + _palette(DARK_COLOURS)
)

THEME = f":root{{color-scheme:light dark;{_LIGHT}}}@media (prefers-color-scheme:dark){{:root{{{_DARK}}}}}"
# A picture that stands alone, in a README say, brings its own colours; it must not repaint its host.
PICTURE_THEME = f"svg{{{_LIGHT}}}@media (prefers-color-scheme:dark){{svg{{{_DARK}}}}}"

DRAWING = (
    "".join(f".a{i}{{--c:var(--a{i})}}" for i in range(len(LIGHT_COLOURS)))
    + f"""
svg text{{font-family:{_FONT};font-size:11px;fill:var(--ink);font-variant-numeric:tabular-nums}}
svg .soft{{fill:var(--soft)}}
svg .sheet{{fill:var(--sheet)}}
svg .grid{{stroke:var(--grid);stroke-width:1}}
svg .axis{{stroke:var(--line);stroke-width:1;fill:none}}
svg .halo{{stroke:var(--sheet);stroke-width:5;fill:none;stroke-linejoin:round;opacity:.9}}
svg .leg{{stroke:var(--c);stroke-width:2.2;fill:none;stroke-linejoin:round;stroke-linecap:round}}
svg .home{{stroke:var(--c);stroke-width:1.3;fill:none;stroke-dasharray:2 4;opacity:.75}}
svg .arrow{{fill:var(--c)}}
svg .stop{{fill:var(--c);stroke:var(--sheet);stroke-width:1.5}}
svg .window{{fill:none;stroke:var(--c);stroke-width:1.2;stroke-dasharray:2.5 2}}
svg .missed{{fill:var(--sheet);stroke:var(--bad);stroke-width:1.8}}
svg .cross{{stroke:var(--bad);stroke-width:1.8;stroke-linecap:round}}
svg .shared{{--c:var(--soft)}}
svg .order{{fill:#fff;font-weight:650;text-anchor:middle;dominant-baseline:central}}
svg .name{{font-size:10.5px;fill:var(--ink);paint-order:stroke;
 stroke:var(--sheet);stroke-width:3px;stroke-linejoin:round}}
svg.chart-map .soft{{paint-order:stroke;stroke:var(--sheet);stroke-width:5px}}
svg .missed-name{{fill:var(--bad)}}
svg .place{{font-weight:650}}
svg .base{{fill:var(--ink);stroke:var(--sheet);stroke-width:1.5}}
svg .origin{{fill:var(--sheet);stroke:var(--c);stroke-width:2}}
svg .rule{{stroke:var(--ink);stroke-width:1.6;fill:none}}
svg .ink{{fill:var(--ink)}}
svg .travel{{stroke:var(--c);stroke-width:2;opacity:.85}}
svg .back{{stroke:var(--c);stroke-width:1.4;stroke-dasharray:2 4;opacity:.85}}
svg .service{{fill:var(--c)}}
svg .waiting{{fill:url(#hatch);stroke:var(--line);stroke-width:.8}}
svg .hatch{{stroke:var(--soft);stroke-width:1.2}}
svg .open{{fill:var(--c);opacity:.28}}
svg .inside{{fill:#fff;font-size:10px;font-weight:600;text-anchor:middle;dominant-baseline:central}}
svg .row{{font-weight:600}}
svg .bar{{fill:var(--accent)}}
svg .bar.two{{fill:var(--a2)}}
svg .mark{{stroke:var(--good);stroke-width:1.4;stroke-dasharray:4 3}}
svg .mark-name{{fill:var(--good);font-weight:600}}
@media (prefers-color-scheme:dark){{svg .order,svg .inside{{fill:#0e1318}}}}
"""
)

PAGE = f"""
*{{box-sizing:border-box}}
html{{-webkit-text-size-adjust:100%}}
body{{margin:0;background:var(--bg);color:var(--ink);font:15px/1.5 {_FONT};font-variant-numeric:tabular-nums}}
main{{max-width:1180px;margin:0 auto;padding:32px 24px 48px}}
header{{margin-bottom:20px}}
.over{{color:var(--soft);font-size:13px;font-weight:600;margin:0}}
h1{{font-size:30px;line-height:1.2;letter-spacing:-.015em;margin:4px 0 8px;overflow-wrap:anywhere}}
h2{{font-size:17px;letter-spacing:-.005em;margin:0 0 4px}}
p{{margin:0 0 10px}}
.lead{{font-size:16.5px;max-width:74ch;margin:0;text-wrap:pretty}}
.hint{{color:var(--soft);font-size:13px;max-width:110ch;margin:0 0 12px;text-wrap:pretty}}
.badges{{display:flex;flex-wrap:wrap;gap:8px;margin:14px 0 0;padding:0;list-style:none}}
.badge{{font-size:13px;font-weight:600;padding:3px 11px;border-radius:99px;
 background:var(--good-bg);color:var(--good)}}
.badge.bad{{background:var(--bad-bg);color:var(--bad)}}
.badge.warn{{background:var(--warn-bg);color:var(--warn)}}
.figures{{display:grid;grid-template-columns:repeat(auto-fit,minmax(132px,1fr));
 gap:1px;background:var(--card);border:1px solid var(--line);border-radius:12px;
 overflow:hidden;margin:0 0 18px}}
.figures div{{box-shadow:0 0 0 1px var(--line);padding:13px 16px}}
.figures dt{{color:var(--soft);font-size:12.5px}}
.figures dd{{margin:1px 0 0;font-size:21px;font-weight:650;letter-spacing:-.01em;white-space:nowrap}}
.figures small{{font-size:13px;font-weight:500;color:var(--soft)}}
section{{background:var(--card);border:1px solid var(--line);border-radius:12px;
 padding:18px 20px;margin:0 0 18px}}
.map{{display:grid;grid-template-columns:minmax(0,1fr) 268px;gap:22px;align-items:start}}
svg{{display:block;width:100%;height:auto}}
.scroll{{overflow-x:auto}}
.charts{{display:grid;grid-template-columns:1fr 1fr;gap:26px}}
.charts h3,.key h3{{font-size:13px;font-weight:600;margin:0 0 6px}}
.agents{{list-style:none;margin:0 0 16px;padding:0;max-height:520px;overflow:auto}}
.agents li{{display:grid;grid-template-columns:26px 1fr auto;gap:8px;align-items:center;
 padding:5px 6px;border-radius:7px;cursor:pointer;border-bottom:1px solid var(--grid)}}
.agents li:hover,.agents li:focus-visible,.agents li.pinned{{background:var(--grid);outline:none}}
.agents b{{font-weight:600;font-size:14px;overflow-wrap:anywhere}}
.agents span{{color:var(--soft);font-size:12.5px;white-space:nowrap}}
.legend{{list-style:none;margin:0;padding:0;font-size:12.5px;color:var(--soft)}}
.legend li{{display:flex;gap:9px;align-items:center;margin:4px 0}}
.legend svg,.agents svg{{width:26px;flex:none}}
table{{border-collapse:collapse;width:100%;font-size:13.5px}}
th{{text-align:left;font-weight:600;color:var(--soft);font-size:12.5px;padding:6px 10px;
 border-bottom:1.5px solid var(--line);white-space:nowrap}}
td{{padding:5px 10px;border-bottom:1px solid var(--grid);vertical-align:top}}
td.wide{{overflow-wrap:anywhere;min-width:15ch}}
.n{{text-align:right;white-space:nowrap}}
td.first{{border-left:4px solid var(--c);font-weight:600;white-space:nowrap}}
td.more{{border-left:4px solid var(--c)}}
tr.total td{{border-bottom:1.5px solid var(--line);color:var(--soft);font-size:12.5px}}
footer{{color:var(--soft);font-size:12.5px;margin-top:22px}}
[data-agent]{{transition:opacity .12s}}
.focus [data-agent]:not(.on){{opacity:.13}}
.focus .agents [data-agent]:not(.on),.focus tr[data-agent]:not(.on){{opacity:.45}}
@media (max-width:820px){{
 .map,.charts{{grid-template-columns:minmax(0,1fr)}}
 .agents{{max-height:380px}}
}}
@media (max-width:620px){{
 main{{padding:20px 12px 32px}} section{{padding:14px 12px}} h1{{font-size:24px}} .lead{{font-size:15px}}
 .figures{{grid-template-columns:1fr 1fr}} .figures div{{padding:10px 12px}} .figures dd{{font-size:18px}}
 .chart-map .name:not(.place){{display:none}}
 .chart-map text{{font-size:18px}} .chart-map .place{{font-size:16px}} .chart-map{{overflow:visible}}
 .chart-map .leg{{stroke-width:3.4}}
 .chart-time{{min-width:1000px}} .bars text{{font-size:14px}}
 td,th{{padding:5px 6px}}
}}
@media print{{
 :root{{{_LIGHT}}}
 *{{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
 body{{background:#fff;font-size:11pt}} main{{max-width:none;padding:0}}
 section,.figures{{break-inside:avoid;border-color:#ccc}}
 section.long{{break-inside:auto}} tr{{break-inside:avoid}}
 .agents{{max-height:none}} .screen{{display:none}}
 svg .order,svg .inside{{fill:#fff}}
}}
"""

SCRIPT = """(() => {
const root = document.documentElement;
let pinned = null;
function show(agent) {
  root.classList.toggle("focus", agent !== null);
  for (const item of document.querySelectorAll("[data-agent]"))
    item.classList.toggle("on", item.dataset.agent === agent);
  for (const item of document.querySelectorAll(".agents li"))
    item.classList.toggle("pinned", pinned !== null && item.dataset.agent === pinned);
}
function at(event) { const item = event.target.closest("[data-agent]"); return item && item.dataset.agent; }
function pin(agent) { pinned = pinned === agent ? null : agent; show(pinned); }
document.addEventListener("pointerover", event => { show(at(event) || pinned); });
document.addEventListener("click", event => { if (event.target.closest(".agents")) pin(at(event)); });
document.addEventListener("keydown", event => {
  if (event.key === "Escape") { pinned = null; show(null); }
  if (event.key === "Enter" && event.target.closest(".agents")) pin(at(event));
});
})();"""


def content_policy() -> str:
    """Return the page's security policy: nothing is loaded, no script runs but ours."""
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    return f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
