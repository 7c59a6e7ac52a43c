"""Writes the C++ code that converts messages to the JSON of the test vectors."""

from cpp import Cpp


class CppJson(Cpp):
    def value(self, f):
        m = self.member(f)
        if f.is_list:
            if "bytes" in f:
                return f"Hex({m})"
            if f.type in self.schema.tables:
                return f"ListJson({m})"
            return f"NumbersJson({m})" if "enumerators" in f else m
        if f.type in self.schema.tables:
            if "json_array" in f:
                parts = self.schema.tables[f.type].fields
                return "Json::array({" + ", ".join(f"{m}.{part.name}" for part in parts) + "})"
            return f"{m} ? Fields(*{m}) : Json(nullptr)" if "optional" in f else f"Fields({m})"
        if f.default == "null":
            return f"{m} ? Json(*{m}) : Json(nullptr)"
        if f.type in ("ulong", "long"):
            return f"Decimal({m})"
        if f.type in self.schema.enums or "status" in f:
            return f"Number({m})"
        return f"!{m}" if "inverted" in f else m

    def condition(self, f):
        if "json_omit" not in f:
            return ""
        m = f"m.{f.get('json_omit')}" if f.get("json_omit") else self.member(f)
        if f.is_list:
            return f"if (!{m}.empty()) "
        return f"if (Number({m}) != 0) " if f.type in self.schema.enums else f"if ({m}) "

    def ordered(self, table):
        fields = [f for f in table.fields if "json_place" not in f]
        for f in table.fields:
            if "json_place" in f:
                fields.insert(int(f.get("json_place")), f)
        return fields

    def json_function(self, table):
        fields = self.ordered(table)
        signature = f"Json Fields(const {self.type_name(table.name)}& m)"
        if self.member(fields[0]) == "m":
            return self.function(signature, ["return m;"])
        lines = ["Json json = Json::object();"]
        lines += [f'{self.condition(f)}json["{f.name}"] = {self.value(f)};' for f in fields]
        return self.function(signature, lines + ["return json;"])

    @property
    def objects(self):
        return [t for t in self.schema.tables.values()
                if "native" not in t]

    def header(self):
        declarations = "".join(f"[[nodiscard]] Json Fields(const {self.type_name(t.name)}& m);\n"
                               for t in self.objects)
        return (self.head() + "#pragma once\n\nnamespace stridewire::protocol {\n\n" +
                declarations + "\n}  // namespace stridewire::protocol\n")

    def source(self):
        functions = "\n".join(self.json_function(t) for t in self.objects if not t.by_hand("json"))
        return (self.head() + '#include "json_support.h"\n\nnamespace stridewire::protocol {\n\n' +
                functions + "\n}  // namespace stridewire::protocol\n")
