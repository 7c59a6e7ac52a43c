#!/usr/bin/env python3
"""Draws two BVH files of the same choreography, one above the other.

Both are drawn as strips of poses (left side orange, right side blue) or as a curve over time: the
angle of the right knee, or the height, speed, sideways position, heading or distance to the last
place of the pelvis. Writes SVG with gnuplot and needs only Python's standard library.

    draw_before_after.py BEFORE.bvh AFTER.bvh OUT.svg --title TEXT
                         [--curve knee|height|speed|sway|heading|distance] [--every 0.25] [--from 0]
                         [--to 60] [--ground Z,Y,Z,Y,...]
"""
import argparse
import math
import subprocess
import sys

from draw_walk import place, read_bvh

LEFT, RIGHT, MIDDLE = "#d55e00", "#0072b2", "#555555"
CURVES = {"knee": "right knee, degrees", "height": "pelvis above its mean, cm",
          "speed": "pelvis speed, m/s", "sway": "pelvis sideways, mm",
          "heading": "heading of the hips, degrees", "distance": "pelvis to its last place, m"}


def side(name):
    if name.startswith(("Left", "LHip", "LThumb")):
        return LEFT
    return RIGHT if name.startswith(("Right", "RHip", "RThumb")) else MIDDLE


def angle(a, b, c):
    """Returns by how many degrees the chain a, b, c is bent at b; 0 is straight."""
    u = [b[k] - a[k] for k in range(3)]
    v = [c[k] - b[k] for k in range(3)]
    cosine = sum(x * y for x, y in zip(u, v)) / (math.hypot(*u) * math.hypot(*v))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


class Recording:
    def __init__(self, path, options):
        self.joints, rows, self.step_s = read_bvh(path)
        self.first = int(options.begin / self.step_s)
        rows = rows[self.first:min(len(rows), int(options.end / self.step_s) + 1)]
        self.frames = [place(self.joints, row) for row in rows]
        self.index = {joint[0]: k for k, joint in enumerate(self.joints)}

    def strip(self, every_s):
        """Returns the lines of the poses by colour, as (z, y) in metres."""
        lines = {LEFT: [], RIGHT: [], MIDDLE: []}
        for f in range(0, len(self.frames), max(1, round(every_s / self.step_s))):
            for k, (name, parent, _, _) in enumerate(self.joints):
                if parent >= 0:
                    lines[side(name)].append(
                        "\n".join(f"{p[2]:.3f} {p[1]:.3f}"
                                  for p in (self.frames[f][parent], self.frames[f][k])) + "\n")
        return lines

    def curve(self, kind):
        """Returns rows of time and value."""
        if kind == "knee":
            chain = [self.index[name] for name in ("RightUpLeg", "RightLeg", "RightFoot")]
            values = [angle(*(frame[k] for k in chain)) for frame in self.frames]
        elif kind == "height":
            mean = sum(frame[0][1] for frame in self.frames) / len(self.frames)
            values = [100.0 * (frame[0][1] - mean) for frame in self.frames]
        elif kind == "sway":
            mean = sum(frame[0][0] for frame in self.frames) / len(self.frames)
            values = [1000.0 * (frame[0][0] - mean) for frame in self.frames]
        elif kind == "heading":
            values = self.headings_deg()
        elif kind == "distance":
            last = self.frames[-1][0]
            values = [math.hypot(frame[0][0] - last[0], frame[0][2] - last[2])
                      for frame in self.frames]
        else:
            values = [math.hypot(b[0][0] - a[0][0], b[0][2] - a[0][2]) / self.step_s
                      for a, b in zip(self.frames, self.frames[1:])]
        return "\n".join(f"{(self.first + f) * self.step_s:.3f} {v:.3f}"
                         for f, v in enumerate(values))

    def headings_deg(self):
        """Returns the heading of the line between the hips, without jumps at half-turns."""
        left, right = self.index["LeftUpLeg"], self.index["RightUpLeg"]
        headings = []
        for frame in self.frames:
            across = [frame[left][k] - frame[right][k] for k in range(3)]
            heading = math.degrees(math.atan2(-across[2], across[0]))
            if headings:
                heading += 360.0 * round((headings[-1] - heading) / 360.0)
            headings.append(heading)
        return headings

    def extent(self):
        along = [p[2] for frame in self.frames for p in frame]
        return min(along), max(along), max(p[1] for frame in self.frames for p in frame)


def draw_strips(recordings, options):
    extents = [recording.extent() for recording in recordings]
    left, right = min(e[0] for e in extents) - 0.1, max(e[1] for e in extents) + 0.1
    top = max(e[2] for e in extents) + 0.1
    pixels_per_m = min(180.0, 1000.0 / (right - left))
    width = max(500, round(pixels_per_m * (right - left)))
    height = round(pixels_per_m * (top + 0.1))
    script = []
    ground = [float(v) for v in options.ground.split(",")] if options.ground else []
    points = list(zip(ground[0::2], ground[1::2])) or [(left, 0.0), (right, 0.0)]
    script.append("$ground << EOD\n" + "\n".join(f"{z} {y}" for z, y in points) + "\nEOD")
    for n, recording in enumerate(recordings):
        for colour, lines in recording.strip(options.every).items():
            script.append(f"${'ba'[n]}{colour[1:]} << EOD\n" + "\n".join(lines) + "\nEOD")
    script.append(f"""
set terminal svg noenhanced size {width},{2 * height + 60} font 'sans-serif,13' background '#ffffff'
set output '{options.svg}'
set multiplot layout 2,1 title "{options.title}"
unset key; unset border; unset tics; set size ratio -1
set lmargin 1; set rmargin 1; set tmargin 1.5; set bmargin 0.5
set xrange [{left:.2f}:{right:.2f}]; set yrange [-0.1:{top:.2f}]""")
    for n, label in enumerate(("before", "after")):
        script.append(f"set label 1 '{label}' at graph 0.01, graph 0.95 font ',15'")
        script.append("plot $ground w l lc rgb '#999999' lw 1, " + ", ".join(
            f"${'ba'[n]}{c[1:]} w l lc rgb '{c}' lw 1" for c in (RIGHT, MIDDLE, LEFT)))
    script.append("unset multiplot")
    return script


def draw_curves(recordings, options):
    script = [f"${'ba'[n]} << EOD\n{recording.curve(options.curve)}\nEOD"
              for n, recording in enumerate(recordings)]
    script.append(f"""
set terminal svg noenhanced size 1000,320 font 'sans-serif,13' background '#ffffff'
set output '{options.svg}'
set title "{options.title}"; set key outside top right horizontal; set border 3; set tics nomirror
set xlabel 's'; set ylabel '{CURVES[options.curve]}'
plot $b w l lc rgb '#999999' lw 1.5 t 'before', $a w l lc rgb '{RIGHT}' lw 1.5 t 'after'
""")
    return script


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("svg")
    parser.add_argument("--title", required=True)
    parser.add_argument("--curve", choices=CURVES, help="draw this instead of poses")
    parser.add_argument("--every", type=float, default=0.25, help="seconds between poses")
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--to", dest="end", type=float, default=1e9)
    parser.add_argument("--ground", default="", help="ground profile Z,Y,Z,Y,...")
    options = parser.parse_args()
    recordings = [Recording(path, options) for path in (options.before, options.after)]
    script = (draw_curves if options.curve else draw_strips)(recordings, options)
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    sys.exit(main())
