"""Writes the functions of the Python and C# packages that request movements, from the schema.

Each type of movement has the fields that it uses (attribute `only` of the table RequestItem).
"""

import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.append(str(ROOT / "protocol/generator"))

from schema import Schema  # noqa: E402: the path is set above.

UNIT = r"_(m_s|m|rad)$"

# Type of movement: name in Python, parameters that may be positional, documentation.
PYTHON = {
    "Step": ("step", ["length_m: float = 0.0"],
             "Requests a step by length, or to the place `at_m` for the ball of the foot."),
    "Walk": ("walk_to", ["at_m: Vec3", "heading_rad: float = 0.0"],
             "Requests a walk to a place and heading."),
    "Jump": ("jump", ["length_m: float"], "Requests a jump."),
    "Stand": ("stand", ["seconds: float"], "Requests to stand for a time."),
}
# Name in C#: type, first parameter after the avatar, documentation. A step is requested by its
# parameters or to a place, and each function has only the fields that its form of a step uses.
CSHARP = {
    "Step": ("Step", "length_m",
             "Requests a step by length: the forward distance between the feet at its end."),
    "StepTo": ("Step", "at_m", "Requests a step that places the ball of the foot at a position."),
    "Jump": ("Jump", "length_m", "Requests a jump with both feet."),
    "Stand": ("Stand", "seconds", "Requests to stand for a time."),
    "WalkTo": ("Walk", "at_m", "Requests a walk to a position and heading, through at most 64 "
                               "waypoints."),
}


def movement_fields():
    """Returns the fields of each type of movement."""
    path = ROOT / "protocol/schema/stridewire.fbs"
    schema = Schema(path.name, path.read_text(encoding="utf-8"))
    item = schema.tables["RequestItem"]
    return {table.name.removesuffix("Movement"): table.fields
            for table in schema.alternatives(item)}


def flag(f):
    """The member of the C struct that states whether a number is present."""
    return "has_" + re.sub(UNIT, "", f.name)


def name_of(f):
    """The member of the C struct; `must_be_near` is `allow_nearest` there."""
    return f.get("cpp", f.name)


def is_optional(f):
    return f.default == "null" or "optional" in f


# ------------------------------------------------------------------------------------------ Python

def python_parameter(f):
    if f.is_list:
        return f"{f.name}: Sequence[Vec3] = ()"
    if f.type == "Vec3":
        return f"{f.name}: Vec3 | None = None"
    if f.type == "double":
        return f"{f.name}: float{' | None = None' if is_optional(f) else ' = 0.0'}"
    return {"bool": f"{name_of(f)}: bool = False",
            "FootChoice": f"{f.name}: Foot = Foot.AUTO"}[f.type]


def python_function(kind, fields):
    name, first, text = PYTHON[kind]
    given = {parameter.split(":")[0] for parameter in first}
    keywords = [python_parameter(f) for f in fields if f.name not in given]
    parameters = ["self", "avatar: int", *first, "*", *keywords,
                  "interrupt: Interrupt = Interrupt.QUEUED"]
    values = [f"avatar=avatar, type=_{kind.upper()}"]
    values += [f"{name_of(f)}={name_of(f)}" for f in fields
               if not is_optional(f) and not f.is_list and f.type != "Vec3"]
    values += [f"{f.name}=point({f.name})" for f in fields
               if f.type == "Vec3" and not f.is_list and not is_optional(f)]
    values.append("interrupt=interrupt")
    lines = wrapped("    def %s(" % name, parameters, ") -> int:")
    lines.append(f'        """{text}"""')
    lines += wrapped("        m = _abi.stridewire_movement(", values, ")")
    for f in fields:
        if f.is_list:
            lines += [f"        numbers = [number for each in {f.name} for number in point(each)]",
                      f"        m.{f.name} = (c.c_double * len(numbers))(*numbers)",
                      f"        m.{re.sub('s_m$', '', f.name)}_count = len({f.name})"]
        elif is_optional(f):
            value = f"point({f.name})" if f.type == "Vec3" else f.name
            lines += [f"        if {f.name} is not None:",
                      f"            m.{flag(f)}, m.{f.name} = 1, {value}"]
    return [*lines, "        return self._request(m)", ""]


def wrapped(start, parts, end):
    """Wraps a list of arguments, with the following lines below the first argument."""
    text = textwrap.wrap(", ".join(parts).replace(": ", ":~").replace(" = ", "~=~")
                         .replace(" | ", "~|~") + end.replace(" ", "~"), 100 - len(start),
                         break_long_words=False, break_on_hyphens=False)
    text = [line.replace("~", " ") for line in text]
    return [start + text[0], *(" " * len(start) + line for line in text[1:])]


def python_functions(generated):
    lines = ['"""The functions that request movements.', "", generated, '"""', "",
             "from __future__ import annotations", "", "import ctypes as c",
             "from collections.abc import Sequence", "", "from . import _abi",
             "from ._types import Foot, Interrupt, Vec3, point", "",
             "_STEP, _JUMP, _STAND, _WALK = range(4)", "", "", "class Requests:",
             '    """Requests of movements. Each returns the id of the request, for `wait`."""', "",
             "    def _request(self, movement: _abi.stridewire_movement) -> int:",
             "        raise NotImplementedError", ""]
    for kind, fields in sorted(movement_fields().items(), key=lambda f: list(PYTHON).index(f[0])):
        lines += python_function(kind, fields)
    return "\n".join(lines)


# ---------------------------------------------------------------------------------------------- C#

def csharp_name(f):
    name = name_of(f)
    words = (re.sub(UNIT, "", name) if f.type == "Vec3" else name).split("_")
    return words[0] + "".join(word.capitalize() for word in words[1:])


def csharp_parameter(f, is_first):
    kind, default = {"bool": ("bool", "false"), "FootChoice": ("Foot", "Foot.Auto"),
                     "double": ("double", "0.0"), "Vec3": ("Position", "")}[f.type]
    if f.is_list:
        kind, default = kind + "[]", "null"
    elif is_optional(f) and not is_first:
        kind, default = kind + "?", "null"
    return f"{kind} {csharp_name(f)}" + ("" if is_first else f" = {default}")


def csharp_value(f, is_first):
    name, member = csharp_name(f), name_of(f)
    if f.type == "Vec3":
        present = [f"m.{flag(f)} = 1;"] if is_optional(f) else []
        return [*present, f"Write({name}, m.{member});"]
    if is_optional(f) and not is_first:
        return [f"m.{flag(f)} = Client.ToByte({name}.HasValue);",
                f"m.{member} = {name}.GetValueOrDefault();"]
    return [f"m.{member} = " + (f"Client.ToByte({name});" if f.type == "bool" else f"{name};")]


def csharp_function(name, fields):
    kind, first, text = CSHARP[name]
    if kind == "Step":
        place = first == "at_m"
        fields = [f for f in fields if f.get("without" if place else "with") != "at_m"
                  and (place or f.name != "at_m")]
    fields.sort(key=lambda f: f.name != first)  # Stable.
    parameters = ["uint avatar", *(csharp_parameter(f, f.name == first) for f in fields),
                  "Interrupt interrupt = Interrupt.Queued"]
    lines = textwrap.wrap(f"<summary>{text}</summary>", 100, initial_indent="        /// ",
                          subsequent_indent="        /// ")
    lines += csharp_wrapped(f"        public ulong {name}(", parameters, ")")
    lines += ["        {", "            stridewire_movement m = "
              f"MakeMovement(avatar, MovementType.{kind}, interrupt);"]
    for f in fields:
        if not f.is_list:
            lines += [f"            {line}" for line in csharp_value(f, f.name == first)]
    lists = [f for f in fields if f.is_list]
    for f in lists:
        count = re.sub("s_m$", "", f.name) + "_count"
        lines += [f"            fixed (Position* points = {csharp_name(f)})"
                  "  // The layout is that of three doubles.",
                  "            {", f"                m.{f.name} = (double*)points;",
                  f"                m.{count} = (UIntPtr)({csharp_name(f)} == null ? 0 : "
                  f"{csharp_name(f)}.Length);",
                  "                return Request(ref m);", "            }"]
    return [*lines, *([] if lists else ["            return Request(ref m);"]), "        }", ""]


def csharp_wrapped(start, parts, end):
    text = textwrap.wrap(", ".join(part.replace(" ", "~") for part in parts) + end,
                         100 - len(start), break_long_words=False, break_on_hyphens=False)
    text = [line.replace("~", " ") for line in text]
    return [start + text[0], *(" " * len(start) + line for line in text[1:])]


def csharp_functions(generated):
    fields = movement_fields()
    lines = [f"// {generated}", "using System;", "", "namespace Stridewire", "{",
             "    public sealed unsafe partial class World", "    {"]
    for name, (kind, _, _) in CSHARP.items():
        lines += csharp_function(name, list(fields[kind]))
    return "\n".join([*lines[:-1], "    }", "}", ""])
