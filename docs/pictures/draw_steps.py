#!/usr/bin/env python3
"""Draws a BVH file as a strip of poses and a view from above.

The strip shows the figure from its right side. The view from above shows standing feet from heel to
toe tip (left orange, right blue) and the paths of ankles and pelvis. Writes SVG with gnuplot.

    draw_steps.py STEPS.bvh OUT.svg [--every 0.25] [--from 0] [--to 60] [--front] [--gap 0.35]
                  [--film] [--ground Z,Y,Z,Y,...|feet] [--title TEXT]
"""
import argparse
import math
import subprocess
import sys

from draw_walk import place, read_bvh

LEFT, RIGHT, MIDDLE = "#d55e00", "#0072b2", "#555555"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bvh")
    parser.add_argument("svg")
    parser.add_argument("--every", type=float, default=0.25, help="seconds between poses")
    parser.add_argument("--from", dest="begin", type=float, default=0.0)
    parser.add_argument("--to", dest="end", type=float, default=1e9)
    parser.add_argument("--front", action="store_true", help="show the figure from the front")
    parser.add_argument("--film", action="store_true",
                        help="show the poses one beside the other, from slightly above")
    parser.add_argument("--gap", type=float, default=0.0, help="extra metres between poses")
    parser.add_argument("--ground", default="",
                        help="ground profile Z,Y,Z,Y,... or 'feet', which draws treads from 14 cm "
                        "behind a ball that steps up to 1 cm ahead of a ball that steps down")
    parser.add_argument("--title", default="")
    options = parser.parse_args()
    joints, rows, step_s = read_bvh(options.bvh)
    first = int(options.begin / step_s)
    rows = rows[first:min(len(rows), int(options.end / step_s) + 1)]
    frames = [place(joints, row) for row in rows]
    index = {joint[0]: k for k, joint in enumerate(joints)}

    def side(name):
        if name.startswith(("Left", "LHip", "LThumb")):
            return 0
        return 1 if name.startswith(("Right", "RHip", "RThumb")) else 2

    blocks = [[], [], []]
    shown = list(range(0, len(frames), max(1, round(options.every / step_s))))
    axis, sign = (0, -1.0) if options.front else (2, 1.0)
    across, heights = [], []
    for count, f in enumerate(shown):
        root = frames[f][0] if options.film else (0.0, 0.0, 0.0)
        gap, above = (0.75, 0.3) if options.film else (options.gap, 0.0)
        for k, (name, parent, _, _) in enumerate(joints):
            if parent < 0:
                continue
            ends = [(sign * (p[axis] - root[axis]) + gap * count, p[1] + above * (p[0] - root[0]))
                    for p in (frames[f][parent], frames[f][k])]
            across += [ends[0][0], ends[1][0]]
            heights += [ends[0][1], ends[1][1]]
            blocks[side(name)].append("\n".join(f"{x:.4f} {y:.4f}" for x, y in ends) + "\n")
    script = [f"${n} << EOD\n" + "\n".join(block) + "\nEOD"
              for n, block in zip(("left", "right", "middle"), blocks)]

    # A foot stands if its ball is slower than 0.1 m/s for at least 0.12 s.
    stands, ways, holds = [[], []], [[], []], []
    for foot, name in enumerate(("Left", "Right")):
        ankle, ball = index[name + "Foot"], index[name + "ToeBase"]
        tip = next(k for k, joint in enumerate(joints) if joint[1] == ball)
        still = 0
        for f in range(len(frames)):
            at = frames[f]
            ways[foot].append(f"{-at[ankle][0]:.4f} {at[ankle][2]:.4f}")
            if f == 0:
                continue
            speed = math.dist(at[ball], frames[f - 1][ball]) / step_s
            still = still + 1 if speed < 0.1 else 0
            if still == max(2, round(0.12 / step_s)):
                dx, dz = at[ball][0] - at[ankle][0], at[ball][2] - at[ankle][2]
                heel = (at[ankle][0] - 0.45 * dx, at[ankle][2] - 0.45 * dz)
                holds.append((at[ball][2], at[ball][1]))
                stands[foot].append(f"{-heel[0]:.4f} {heel[1]:.4f}\n"
                                    f"{-at[tip][0]:.4f} {at[tip][2]:.4f}\n")
    for foot, name in enumerate(("left", "right")):
        script.append(f"${name}_stands << EOD\n" + "\n".join(stands[foot]) + "\nEOD")
        script.append(f"${name}_way << EOD\n" + "\n".join(ways[foot]) + "\nEOD")
    pelvis = "\n".join(f"{-p[0][0]:.4f} {p[0][2]:.4f}" for p in frames)
    script.append(f"$pelvis << EOD\n{pelvis}\nEOD")
    holds.sort()
    if options.ground == "feet":
        lowest = min(y for _, y in holds)
        sole = [(holds[0][0] - 0.5, 0.0)]
        for (z0, y0), (z1, y1) in zip(holds, holds[1:]):
            if abs(y1 - y0) < 0.05:
                continue
            edge = max(z1 - 0.14, z0 + 0.09) if y1 > y0 else z0 + 0.01
            sole += [(edge, sole[-1][1]), (edge, y1 - lowest)]
        sole.append((holds[-1][0] + 0.5, sole[-1][1]))
        options.ground = ",".join(f"{z:.3f},{y:.3f}" for z, y in sole)
    numbers = [float(v) for v in options.ground.split(",")] if options.ground else []
    profile = list(zip(numbers[::2], numbers[1::2])) or [(min(across) - 1, 0), (max(across) + 1, 0)]
    script.append("$ground << EOD\n" + "\n".join(f"{z} {y}" for z, y in profile) + "\nEOD")

    xs = [-p[k][0] for p in frames for k in (0, index["LeftFoot"], index["RightFoot"])]
    zs = [p[k][2] for p in frames for k in (0, index["LeftFoot"], index["RightFoot"])]
    width, height = max(across) - min(across) + 0.4, max(heights) - min(heights) + 0.4
    above_w, above_h = max(zs) - min(zs) + 0.6, max(xs) - min(xs) + 0.6
    scale = 1200 / max(width, above_w)
    strip_px, above_px = height * scale + 60, above_h * scale + 70
    total = strip_px + above_px
    script.append(f"""
set terminal svg size 1200,{total:.0f} font 'sans-serif,13' background '#ffffff'
set output '{options.svg}'
set multiplot
set size 1,{strip_px / total:.4f}; set origin 0,{above_px / total:.4f}; set size ratio -1
set xrange [{min(across) - 0.2:.2f}:{max(across) + 0.2:.2f}]
set yrange [{min(heights) - 0.1:.2f}:{max(heights) + 0.1:.2f}]
set title "{options.title}"; unset key; set border 3; set tics nomirror
plot $ground w l lc rgb '#000000' lw 1, $right w l lc rgb '{RIGHT}' lw 1.2, \\
  $middle w l lc rgb '{MIDDLE}' lw 1, $left w l lc rgb '{LEFT}' lw 1.2
set xtics 0.5; unset title; set size 1,{above_px / total:.4f}; set origin 0,0
set xrange [{min(zs) - 0.3:.2f}:{max(zs) + 0.3:.2f}]
set yrange [{min(xs) - 0.3:.2f}:{max(xs) + 0.3:.2f}]
set xlabel 'from above, m (forward is right, left is up)'
set yrange [{-max(xs) - 0.3:.2f}:{-min(xs) + 0.3:.2f}]
plot $left_way u 2:(-$1) w l lc rgb '{LEFT}' lw 0.6 dt 3, \\
  $right_way u 2:(-$1) w l lc rgb '{RIGHT}' lw 0.6 dt 3, \\
  $pelvis u 2:(-$1) w l lc rgb '{MIDDLE}' lw 1, \\
  $left_stands u 2:(-$1) w l lc rgb '{LEFT}' lw 5, \\
  $right_stands u 2:(-$1) w l lc rgb '{RIGHT}' lw 5
unset multiplot
""")
    subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


if __name__ == "__main__":
    sys.exit(main())
