"""Writes the C++ code that converts messages to the JSON of the test vectors, and back."""

from cpp import Cpp


class CppJson(Cpp):
    def value(self, f):
        m = self.member(f)
        if f.get("json_array") == "":
            parts = self.schema.tables[f.type].fields
            return "Json::array({" + ", ".join(f"{m}.{part.name}" for part in parts) + "})"
        if "bytes" in f:
            return f"Hexadecimal({m})"
        if f.default == "null" or "optional" in f:
            return f"{m} ? Json(*{m}) : Json()"
        if f.type == "ulong":
            return f"std::to_string({m})"
        return f"!{m}" if "inverted" in f else m

    def condition(self, f):
        if "json_omit" not in f:
            return ""
        m = f"m.{f.get('json_omit')}" if f.get("json_omit") else self.member(f)
        if "inverted" in f:
            return f"if (!{m}) "
        if f.is_list:
            return f"if (!{m}.empty()) "
        if f.type in self.schema.enums:
            return f"if ({m} != {self.type_name(f.type)}{{}}) "
        return f"if ({m}) "

    def ordered(self, table):
        fields = [f for f in table.fields if "json_place" not in f]
        for f in table.fields:
            if "json_place" in f:
                fields.insert(int(f.get("json_place")), f)
        return fields

    def json_function(self, table):
        signature = f"void to_json(Json& json, const {self.type_name(table.name)}& m)"
        lines = ["json = Json::object();"]
        for f in self.ordered(table):
            condition = self.used_if(f, "m.{}") + self.condition(f)
            if "borrowed" in f:  # The decoded poses in the JSON contain all borrowed lists.
                lines += ['json["poses"] = PosesOf(m);'] if f.name == "poses" else []
            elif "variant" in table and f.name == "type":
                lines.append(f'json["type"] = {self.variant(table)}.index();')
            elif f.get("json_array"):
                lines.append(f'json["{f.get("json_array")}"].push_back({self.value(f)});')
            elif "variant" not in table or "only" not in f:
                lines.append(f'{condition}json["{f.name}"] = {self.value(f)};')
        if "variant" in table:
            lines.append("std::visit([&](const auto& used) { json.update(Json(used)); }, "
                         f"{self.variant(table)});")
        return self.function(signature, lines)

    def parse(self, f):
        m = self.member(f)
        if f.get("json_array") == "":
            parts = self.schema.tables[f.type].fields
            return [f'json.at("{f.name}").at({i}).get_to({m}.{part.name});'
                    for i, part in enumerate(parts)]
        if "inverted" in f:
            return [f'{self.used_if(f, "m.{}")}{m} = !json.value("{f.name}", false);']
        return [f'Get(json, "{f.name}", {m});']

    def parse_function(self, table):
        signature = f"void from_json(const Json& json, {self.type_name(table.name)}& m)"
        fields = self.common_fields(table) if "variant" in table else table.fields
        arrays = {}
        lines = []
        for f in fields:
            if "borrowed" in f:
                lines += ["ReadPoses(json, m);"] if f.name == "poses" else []
            elif name := f.get("json_array"):
                position = arrays[name] = arrays.get(name, -1) + 1
                lines.append(f'json.at("{name}").at({position}).get_to({self.member(f)});')
            else:
                lines += self.parse(f)
        if "variant" in table:
            lines.append('switch (json.at("type").get<int>()) {')
            for number, each in enumerate(self.schema.alternatives(table)):
                target = f"{self.variant(table)}.emplace<{each.name}>()"
                lines.append(f"  case {number}: json.get_to({target}); break;")
            lines.append("}")
        return self.function(signature, lines)

    def serializer(self, table):
        """Conversions of a type that is not in namespace protocol."""
        name = f"stridewire::{self.type_name(table.name)}"
        members = [self.member(f) for f in table.fields]
        make = f"json = {{{', '.join(members)}}};"
        parse = " ".join(f"json.at({i}).get_to({m});" for i, m in enumerate(members))
        if "native" not in table:
            make, parse = (f"stridewire::protocol::{name}(json, m);"
                           for name in ("to_json", "from_json"))
        return (f"template <>\nstruct nlohmann::adl_serializer<{name}> {{\n"
                f"  static void to_json(auto& json, const {name}& m) {{ {make} }}\n"
                f"  static void from_json(const auto& json, {name}& m) {{ {parse} }}\n}};\n")

    @property
    def arrays(self):
        return [t for t in self.schema.tables.values() if "native" in t]

    def is_alone(self, table):
        return self.member(table.fields[0]) == "m"

    @property
    def objects(self):
        """The tables with an object in JSON, each after its alternatives."""
        return [each for t in self.schema.tables.values()
                if "native" not in t and not self.is_alone(t)
                for each in (self.schema.alternatives(t) if "variant" in t else []) + [t]]

    def header(self):
        serializers = "".join(self.serializer(t) for t in self.arrays)
        declarations = "".join(f"void to_json(Json& json, const {self.type_name(t.name)}& m);\n"
                               f"void from_json(const Json& json, {self.type_name(t.name)}& m);\n"
                               for t in self.objects)
        serializers += "".join(self.serializer(t) for t in self.objects if "handwritten" in t)
        return (self.head() + "#pragma once\n\nnamespace stridewire::protocol {\n\n" +
                declarations + "\n}  // namespace stridewire::protocol\n\n" + serializers)

    def source(self):
        functions = "\n".join(self.json_function(t) + "\n" + self.parse_function(t)
                              for t in self.objects)
        return (self.head() + '#include "json_support.h"\n\nnamespace stridewire::protocol {\n\n' +
                functions + "\n}  // namespace stridewire::protocol\n")
