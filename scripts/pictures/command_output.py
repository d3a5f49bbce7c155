# SPDX-License-Identifier: Apache-2.0
"""Pictures of what the commands of lenticule write: to a terminal, or as a drawing.

Each function takes a Studio and returns an SVG picture.
"""

import json
import math
import os
import shutil
import time

from pictures.studio import KIOSK_4K, ROOT


def terminal(command, output):
    """Draws a command and what it prints, as a terminal shows them."""
    lines = [f"$ {command}", *output.rstrip("\n").split("\n")]
    width = 16 + math.ceil(8.43 * max(map(len, lines)))
    height = 20 + 18 * len(lines)
    text = "".join(
        f'<tspan x="10" y="{24 + 18 * i}"{" fill=" + chr(34) + "#8fd18f" + chr(34) if i == 0 else ""}>'
        f"{line.replace('&', '&amp;').replace('<', '&lt;').replace('>', '&gt;')}</tspan>\n"
        for i, line in enumerate(lines))
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}">\n<rect width="100%" height="100%" rx="6" fill="#202124"/>\n'
            f'<text xml:space="preserve" font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" '
            f'font-size="14" fill="#ececec">\n{text}</text>\n</svg>\n')


def farm_status(studio):
    """What `farm status` prints of a work folder into which this function writes the reports of eight nodes."""
    work = studio.folder / "work"
    studio.run("farm", "plan", "builtin:tree", "--rig", KIOSK_4K, "--frames", "0:9600", "--chunk", "40",
               "--timed-frames", "0", "-o", "tree.lts", "--work", work)
    plan = json.loads((work / "plan.json").read_text())
    now = time.time()
    speed = (6.1, 6.2, 6.0, 6.1, 9.8, 6.2, 6.1, 6.0)  # seconds of a frame: node05 is a slow machine
    free = [0.0] * len(speed)
    chunk = 0
    while min(free) < 3600:
        node = free.index(min(free))
        seconds = 40 * speed[node] + 3 * (chunk % 5)
        free[node] += seconds
        about = {"chunk": chunk, "node": f"node{node + 1:02}"}
        if chunk == 57:
            made, about = work / "failures", about | {"error": "work: No space left on device", "hint": ""}
        elif free[node] > 3600:
            made = work / "attempts" / f"{chunk:06}" / "1"
            about |= {"done": int((3600 - free[node] + seconds) / speed[node]), "count": 40, "seconds": 1}
        else:
            made, digest = work / "reports", f"{chunk:032x}"
            about |= {"plan": plan["identity"], "begin": 40 * chunk, "end": 40 * chunk + 40, "digest": digest,
                      "bytes": 1, "first_bands": "", "last_bands": "", "isa": "avx2", "threads": 16,
                      "seconds": seconds, "render_seconds": 40 * speed[node], "extra_seconds": 0, "started": 0}
            (work / "chunks" / f"{chunk:06}-{digest}.lts").write_bytes(b"0")
        made.mkdir(parents=True, exist_ok=True)
        file = made / ("progress.json" if made.name == "1" else f"{chunk:06}.json")
        file.write_text(json.dumps(about))
        ended = now - 3600 + free[node] if made.name == "reports" else now
        os.utime(file, (ended, ended))
        chunk += 1
    return terminal("lenticule farm status work", studio.run("farm", "status", work))


def wall(studio):
    """Draws the wall of docs/play/walls.md from the front and from above."""
    page = (ROOT / "docs/play/walls.md").read_text()
    text = page.split("```toml\n", 1)[1].split("```", 1)[0]
    for rig in ("left.toml", "right.toml"):
        shutil.copy(KIOSK_4K, studio.folder / rig)
    (studio.folder / "lobby.toml").write_text(text)
    studio.run("rig", "wall", studio.folder / "lobby.toml", "--svg", studio.folder / "wall.svg")
    return (studio.folder / "wall.svg").read_text()
