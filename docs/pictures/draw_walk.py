#!/usr/bin/env python3
"""Draws stick figures of a BVH file from the side, and heights and speeds of feet and pelvis.

Writes SVG with gnuplot and needs only Python's standard library.

    draw_walk.py WALK.bvh OUT.svg [--every 0.1] [--from 0] [--to 10] [--title TEXT]
"""
import argparse
import math
import subprocess
import sys


def read_bvh(path):
    """Returns joints [(name, parent, offset, channels)], the motion rows and the frame time (s)."""
    words = open(path, encoding="utf-8").read().split()
    joints, stack, i = [], [], 0
    while words[i] != "MOTION":
        word = words[i]
        if word in ("ROOT", "JOINT", "End"):
            parent = stack[-1] if stack else -1
            name = words[i + 1] if word != "End" else joints[parent][0] + " tip"
            joints.append([name, parent, None, []])
            stack.append(len(joints) - 1)
            i += 2
        elif word == "OFFSET":
            joints[-1][2] = [float(v) for v in words[i + 1:i + 4]]
            i += 4
        elif word == "CHANNELS":
            count = int(words[i + 1])
            joints[-1][3] = words[i + 2:i + 2 + count]
            i += 2 + count
        elif word == "}":
            stack.pop()
            i += 1
        else:
            i += 1
    frames, step_s = int(words[i + 2]), float(words[i + 5])
    values = [float(v) for v in words[i + 6:]]
    width = len(values) // frames
    return joints, [values[f * width:(f + 1) * width] for f in range(frames)], step_s


def turn(axis, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {"X": ((1, 0, 0), (0, c, -s), (0, s, c)),
            "Y": ((c, 0, s), (0, 1, 0), (-s, 0, c)),
            "Z": ((c, -s, 0), (s, c, 0), (0, 0, 1))}[axis]


def times(a, b):
    return tuple(tuple(sum(a[r][k] * b[k][c] for k in range(3)) for c in range(3))
                 for r in range(3))


def place(joints, row):
    """Returns the world positions of all joints in one frame."""
    positions, rotations, at = [], [], 0
    for _, parent, offset, channels in joints:
        local, spin = list(offset), ((1, 0, 0), (0, 1, 0), (0, 0, 1))
        for channel in channels:
            axis = channel[0].upper()
            if channel.lower().endswith("position"):
                local["XYZ".index(axis)] = row[at]
            else:
                spin = times(spin, turn(axis, row[at]))
            at += 1
        if parent < 0:
            positions.append(local)
            rotations.append(spin)
        else:
            r, p = rotations[parent], positions[parent]
            positions.append([p[k] + sum(r[k][c] * local[c] for c in range(3)) for k in range(3)])
            rotations.append(times(r, spin))
    return positions


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bvh")
    parser.add_argument("svg")
    parser.add_argument("--every", type=float, default=0.2, help="seconds between stick figures")
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--to", dest="end", type=float, default=1e9)
    parser.add_argument("--title", default="")
    options = parser.parse_args()
    joints, rows, step_s = read_bvh(options.bvh)
    first = int(options.begin / step_s)
    rows = rows[first:min(len(rows), int(options.end / step_s) + 1)]
    frames = [place(joints, row) for row in rows]
    index = {joint[0]: k for k, joint in enumerate(joints)}
    feet = {side: index[side + "ToeBase"] for side in ("Left", "Right")}

    def colour(name):
        if name.startswith(("Left", "LHip", "LThumb")):
            return 0
        return 1 if name.startswith(("Right", "RHip", "RThumb")) else 2

    script = ["$left << EOD", "$right << EOD", "$middle << EOD"]
    for f in range(0, len(frames), max(1, round(options.every / step_s))):
        for k, (name, parent, _, _) in enumerate(joints):
            if parent >= 0:
                a, b = frames[f][parent], frames[f][k]
                script[colour(name)] += f"\n{a[2]:.4f} {a[1]:.4f}\n{b[2]:.4f} {b[1]:.4f}\n"
    script = [block + "\nEOD" for block in script]
    curves = ["$curves << EOD"]
    for f in range(1, len(frames)):
        now, before = frames[f], frames[f - 1]
        speed = [math.hypot(now[k][0] - before[k][0], now[k][2] - before[k][2]) / step_s
                 for k in (feet["Left"], feet["Right"], 0)]
        height = [now[k][1] for k in (feet["Left"], feet["Right"], 0)]
        curves.append(" ".join(f"{v:.4f}" for v in [(first + f) * step_s] + height + speed))
    script += ["\n".join(curves + ["EOD"])]
    z = [p[0][2] for p in frames]
    script.append(f"""
set terminal svg size 1200,760 font 'sans-serif,13' background '#ffffff'
set output '{options.svg}'
set multiplot
set size 1,0.48; set origin 0,0.52; set size ratio -1
set xrange [{min(z) - 0.6:.2f}:{max(z) + 0.6:.2f}]; set yrange [-0.05:2.0]
set title "{options.title}"; set xlabel 'm'; unset key; set border 3; set tics nomirror
plot $right w l lc rgb '#0072b2' lw 1, $middle w l lc rgb '#555555' lw 1, \\
  $left w l lc rgb '#d55e00' lw 1, 0 lc rgb '#000000' lw 0.5
set size noratio; set size 1,0.27; unset title; set key top right horizontal; set xlabel ''
set xrange [{first * step_s:.2f}:{(first + len(frames)) * step_s:.2f}]
set lmargin 8; set rmargin 2
set origin 0,0.26; set yrange [-0.02:0.6]; set ylabel 'height, m'
plot $curves u 1:2 w l lc rgb '#d55e00' lw 1.5 t 'left ball', \\
  '' u 1:3 w l lc rgb '#0072b2' lw 1.5 t 'right ball', \\
  '' u 1:($4-0.7) w l lc rgb '#555555' t 'pelvis - 0.7 m'
set origin 0,0; set yrange [0:5.5]; set ylabel 'speed, m/s'; set xlabel 's'
plot $curves u 1:5 w l lc rgb '#d55e00' lw 1.5 t 'left ball', \\
  '' u 1:6 w l lc rgb '#0072b2' lw 1.5 t 'right ball', \\
  '' u 1:7 w l lc rgb '#555555' lw 1.5 t 'pelvis'
unset multiplot
""")
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    sys.exit(main())
