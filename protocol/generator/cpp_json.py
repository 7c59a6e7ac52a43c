"""Writes the C++ code that converts messages to the JSON of the test vectors, and back."""

from cpp import Cpp


class CppJson(Cpp):
    def value(self, f):
        m = self.member(f)
        if "json_array" in f:
            parts = self.schema.tables[f.type].fields
            return "Json::array({" + ", ".join(f"{m}.{part.name}" for part in parts) + "})"
        return f"!{m}" if "inverted" in f else f"Value({m})"

    def condition(self, f):
        if "json_omit" not in f:
            return ""
        m = f"m.{f.get('json_omit')}" if f.get("json_omit") else self.member(f)
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
        fields = self.ordered(table)
        signature = f"Json Fields(const {self.type_name(table.name)}& m)"
        lines = ["Json json = Json::object();"]
        lines += [f'{self.condition(f)}json["{f.name}"] = {self.value(f)};' for f in fields]
        return self.function(signature, lines + ["return json;"])

    def parse(self, f):
        m = self.member(f)
        if "json_array" in f:
            parts = self.schema.tables[f.type].fields
            return [f'json.at("{f.name}").at({i}).get_to({m}.{part.name});'
                    for i, part in enumerate(parts)]
        if "inverted" in f:
            return [f'if (json.contains("{f.name}")) {m} = !json.at("{f.name}").get<bool>();']
        return [f'Get(json, "{f.name}", {m});']

    def parse_function(self, table):
        signature = f"void FromJson(const Json& json, {self.type_name(table.name)}& m)"
        return self.function(signature, [line for f in table.fields for line in self.parse(f)])

    def is_alone(self, table):
        return self.member(table.fields[0]) == "m"

    @property
    def objects(self):
        return [t for t in self.schema.tables.values()
                if "native" not in t and not self.is_alone(t)]

    def header(self):
        declarations = "".join(f"[[nodiscard]] Json Fields(const {self.type_name(t.name)}& m);\n"
                               f"void FromJson(const Json& json, {self.type_name(t.name)}& m);\n"
                               for t in self.objects)
        return (self.head() + "#pragma once\n\nnamespace stridewire::protocol {\n\n" +
                declarations + "\n}  // namespace stridewire::protocol\n")

    def source(self):
        functions = "\n".join(self.json_function(t) + "\n" + self.parse_function(t)
                              for t in self.objects if not t.by_hand("json"))
        return (self.head() + '#include "json_support.h"\n\nnamespace stridewire::protocol {\n\n' +
                functions + "\n}  // namespace stridewire::protocol\n")
