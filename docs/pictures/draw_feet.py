#!/usr/bin/env python3
"""Draws the same steps with sliding and with planted feet: ball speeds, ball heights and knee bend.

Writes SVG with gnuplot and needs only Python's standard library.

    draw_feet.py SLIDING.bvh PLANTED.bvh OUT.svg [--from 0] [--to 10] [--title TEXT]
"""
import argparse
import math
import subprocess
import sys

from draw_walk import place, read_bvh

SIDES = ("Left", "Right")


def knee_degrees(frame, hip, knee, ankle):
    thigh = [frame[knee][k] - frame[hip][k] for k in range(3)]
    shank = [frame[ankle][k] - frame[knee][k] for k in range(3)]
    dot = sum(a * b for a, b in zip(thigh, shank))
    lengths = math.sqrt(sum(a * a for a in thigh) * sum(b * b for b in shank))
    return math.degrees(math.acos(max(-1.0, min(1.0, dot / lengths))))


def curves(path, begin_s, end_s):
    """Rows of time (s) and, per side, ball speed (m/s), ball height (m) and knee bend (degrees)."""
    joints, rows, step_s = read_bvh(path)
    first, last = int(begin_s / step_s), int(end_s / step_s) + 1
    frames = [place(joints, row) for row in rows[first:last]]
    index = {joint[0]: k for k, joint in enumerate(joints)}
    table = []
    for f in range(1, len(frames)):
        row = [(first + f) * step_s]
        for side in SIDES:
            ball = index[side + "ToeBase"]
            now, before = frames[f][ball], frames[f - 1][ball]
            row.append(math.hypot(now[0] - before[0], now[2] - before[2]) / step_s)
            row.append(now[1])
            row.append(knee_degrees(frames[f], index[side + "UpLeg"], index[side + "Leg"],
                                    index[side + "Foot"]))
        table.append(" ".join(f"{v:.4f}" for v in row))
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sliding")
    parser.add_argument("planted")
    parser.add_argument("svg")
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--to", dest="end", type=float, default=10.0)
    parser.add_argument("--title", default="")
    options = parser.parse_args()
    script = []
    for name, path in (("sliding", options.sliding), ("planted", options.planted)):
        rows = curves(path, options.begin, options.end)
        script.append("\n".join([f"${name} << EOD"] + rows + ["EOD"]))

    def plot(column):
        return (f"plot $sliding u 1:{column} w l dt 2 lc rgb '#d55e00' t 'left, sliding', "
                f"'' u 1:{column + 3} w l dt 2 lc rgb '#0072b2' t 'right, sliding', "
                f"$planted u 1:{column} w l lw 2 lc rgb '#d55e00' t 'left, planted', "
                f"'' u 1:{column + 3} w l lw 2 lc rgb '#0072b2' t 'right, planted'")

    script.append(f"""
set terminal svg size 1200,820 font 'sans-serif,13' background '#ffffff'
set output '{options.svg}'
set multiplot layout 3,1
set border 3; set tics nomirror; set lmargin 9; set rmargin 2; set grid y lc rgb '#dddddd'
set xrange [{options.begin}:{options.end}]; set key top right horizontal
set title "{options.title}"
set ylabel 'ball speed, m/s'; set yrange [0:1.2]
{plot(2)}
unset title; unset key; set ylabel 'ball height, m'; set yrange [*:*]
{plot(3)}
set ylabel 'knee bend, degrees'; set xlabel 's'; set yrange [0:*]
{plot(4)}
unset multiplot
""")
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    sys.exit(main())
