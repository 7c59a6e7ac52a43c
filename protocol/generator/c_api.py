"""Writes the conversion of requests from the struct of the C API to the message structs."""

import re

from cpp import Cpp

UNIT = r"_(m_s|m|rad)$"


class CApi(Cpp):
    """Each member of `stridewire_movement` has the name of the field in the schema, or of the
    member of the message struct. `has_side` states whether `side_m` is used, and `waypoint_count`
    is the length of `waypoints_m`."""

    def source(self, f):
        return f"c.{f.get('cpp', f.name)}"

    def flag(self, f):
        return f"has_{re.sub(UNIT, '', f.name)}"

    def count(self, f):
        return f"c.{re.sub('s_m$', '', f.name)}_count"

    def is_type(self, f):
        enum = self.schema.enums["MovementType"]
        return [f"c.type == {number}" for name, number in enum.values.items()
                if name in f.get("only", "").split()]

    def conditions(self, table):
        """Conditions that the C struct must meet and that the checks of the message do not test."""
        lines = []
        for f in table.fields:
            used = " || ".join(self.is_type(f))
            if f.type in self.schema.enums:
                last = len(self.schema.enums[f.type].values) - 1
                lines.append(f"static_cast<unsigned>(c.{f.name}) <= {last}")
            elif f.is_list:
                lines.append(f"{self.count(f)} <= {self.bound(f.get('max'))}")
                unused = used.replace("==", "!=")
                lines.append(f"({unused} || {self.count(f)} == 0 || c.{f.name} != nullptr)")
            elif f.type == "bool":
                if other := f.get("without"):
                    used = f"(({used}) && c.{other} == 0)"
                lines.append(f"({self.source(f)} == 0 || {used})")
        return lines

    def assign(self, f):
        m, c = self.member(f), self.source(f)
        if f.is_list:
            return [f"for (std::size_t i = 0; i < {self.count(f)}; ++i) {{",
                    f"  const double* v = {c} + 3 * i;",
                    f"  {m}.emplace_back(v[0], v[1], v[2]);", "}"]
        value = {"Vec3": f"DVec3({c}[0], {c}[1], {c}[2])", "bool": f"{c} != 0"}.get(f.type, c)
        if f.type in self.schema.enums:
            value = f"static_cast<{self.type_name(f.type)}>({c})"
        conditions = []
        for other, sign in ((f.get("with"), "!="), (f.get("without"), "==")):
            at = next((each for each in self.item.fields if each.name == other), None)
            if at is not None and at.type != "bool":
                conditions.append(f"c.{self.flag(at)} {sign} 0")
        if f.default == "null" or "optional" in f:
            conditions.append(f"c.{self.flag(f)} != 0")
        used = f"if ({' && '.join(conditions)}) " if conditions else ""
        return [f"{used}{m} = {value};"]

    def header(self):
        self.item = self.schema.tables["RequestItem"]
        enum = self.schema.enums["MovementType"]
        functions = []
        for alternative in self.schema.alternatives(self.item):
            lines = [line for f in alternative.fields for line in self.assign(f)]
            functions.append(self.function(
                f"inline void Read(const stridewire_movement& c, {alternative.name}& m)", lines))
        conditions = " &&\n         ".join(self.conditions(self.item))
        functions.append(
            "/// Returns false if a member has a value that its type does not allow.\n" +
            self.function("inline bool IsMovement(const stridewire_movement& c)",
                          [f"return {conditions};"]))
        lines = [line for f in self.common_fields(self.item) for line in self.assign(f)]
        cases = [f"  case {number}: Read(c, m.movement.emplace<{each.name}>()); break;"
                 for number, each in zip(enum.values.values(), self.schema.alternatives(self.item))]
        functions.append("/// Converts a movement for which IsMovement is true.\n" + self.function(
            "inline RequestItem ToRequestItem(const stridewire_movement& c)",
            ["RequestItem m;", *lines, "switch (static_cast<int>(c.type)) {", *cases,
             "  default: break;", "}", "return m;"]))
        return (self.head() + '#pragma once\n\n#include "stridewire/client.h"\n'
                '#include "stridewire/protocol/messages.h"\n\n'
                "namespace stridewire::protocol {\n\n" + "\n".join(functions) +
                "\n}  // namespace stridewire::protocol\n")
