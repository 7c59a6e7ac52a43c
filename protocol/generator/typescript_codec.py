"""Writes the TypeScript code that reads messages from frames, builds them, and makes their JSON."""

from cpp import camel
from schema import SCALARS
from typescript import ARRAYS, TypeScript, lower_camel

# The method of flatbuffers.Builder that adds a field, without "addField".
ADDERS = {"bool": "Int8", "ubyte": "Int8", "short": "Int16", "ushort": "Int16", "uint": "Int32",
          "ulong": "Int64", "float": "Float32", "double": "Float64"}


class TypeScriptCodec(TypeScript):
    def enum_of(self, f):
        """The name of the enum whose values the field or the entries of its list have, or None."""
        return f.get("enumerators") or (f.type if f.type in self.schema.enums else None)

    def table_of(self, f):
        return self.schema.tables.get(f.type)

    def key_and_value(self, table):
        """The two members of a struct that becomes a property: the name and the value."""
        return sorted(table.fields, key=lambda f: "keys" not in f)

    def is_parameters(self, f):
        return self.table_of(f) is not None and "web" in self.table_of(f)

    def function(self, signature, lines):
        return f"{signature} {{\n" + "".join(f"  {line}\n" for line in lines) + "}\n"

    # ---- conditions: fields that depend on others

    def is_one_of(self, types, prefix=""):
        condition = " || ".join(f"{prefix}type === '{lower_camel(name)}'" for name in types)
        return f"({condition})" if len(types) > 1 else condition

    def used_if(self, f, table, prefix="", unchecked=False):
        """The condition under which a message uses a field, or None. `prefix` precedes the names of
        other properties. If `unchecked`, properties that the message does not use may have values
        as well."""
        types = f.get("only", "").split()

        def has(name):
            other = next(each for each in table.fields if each.name == name)
            value = f"Boolean({prefix}{self.name_of(other)})"
            common = [name for name in types if name in other.get("only", "").split()]
            if not unchecked or common == types:
                return value
            return f"({value} && {self.is_one_of(common, prefix)})"

        parts = [self.is_one_of(types, prefix)] if types else []
        parts += [has(f.get("with"))] if "with" in f else []
        parts += [f"!{has(f.get('without'))}"] if "without" in f else []
        return " && ".join(parts) or None

    def deciding(self, table):
        """The names of fields on which others depend."""
        return {f.get(condition) for f in table.fields for condition in ("with", "without")} | (
            {"type"} if any("only" in f for f in table.fields) else set())

    # ---- reading

    def read(self, f):
        """The value of a field that the accessor `w` refers to."""
        name, table, enum = lower_camel(f.name), self.table_of(f), self.enum_of(f)
        w = f"w.{name}()"
        if f.is_list and table is None:
            array = f"w.{name}Array() ?? new {ARRAYS.get(f.type)}(0)"
            return f"Array.from({array}, (value) => enums.{enum}[value]!)" if enum else array
        if f.is_list:
            entries = (f"Array.from({{length: w.{name}Length()}}, "
                       f"(_, i) => read{f.type}(w.{name}(i)))")
            return f"Object.fromEntries({entries})" if self.is_parameters(f) else entries
        if f.type == "string":
            return f"text(w.{name}(Encoding.UTF8_BYTES))"
        if table is not None:
            return f"{w} && read{f.type}({w})" if "optional" in f else f"read{f.type}({w})"
        if enum:
            return f"enums.{enum}[{w}]!"
        if "inverted" in f:
            return f"!{w}"
        return f"Number({w})" if f.type == "ulong" and "number" in f else w

    def unused(self, f):
        """The value of a field that a message does not use."""
        if f.is_list:
            return "[]"
        if self.enum_of(f):
            return f"'{lower_camel(self.first_value(f))}'"
        if "optional" in f or f.default == "null":
            return "null"
        if f.type == "bool":
            return f.get("initial", "true" if "inverted" in f else "false")
        return f.default or "0"

    def first_value(self, f):
        return f.default or next(iter(self.schema.enums[self.enum_of(f)].values))

    def read_function(self, table):
        lines, deciding = [], self.deciding(table)
        kind = f"wire.{table.name}"
        if self.only_member(table):
            result = self.type_of(self.only_member(table))
            lines = [f"return {self.read(table.fields[0])};"]
        elif "web" in table:
            key, value = self.key_and_value(table)
            result = "[string, number]"
            lines = [f"return [enums.{key.get('keys')}[w.{key.name}()]!, w.{value.name}()];"]
        elif self.is_tuple(table):
            result = f"[{', '.join(['number'] * len(table.fields))}]"
            lines = [f"return [{', '.join(f'w.{f.name}()' for f in table.fields)}];"]
        else:
            result = self.interface_name(table)
            properties = [f"  type: '{table.name}',"] if "message" in table else []
            for f in sorted(table.fields, key=lambda f: "with" in f or "without" in f):
                name, value = self.name_of(f), self.read(f)
                if condition := self.used_if(f, table):
                    value = f"{condition} ? {value} : {self.unused(f)}"
                if f.name in deciding:
                    lines.append(f"const {name} = {value};")
            for name, (f, *others) in self.properties(table).items():
                value = self.read(f)
                if condition := self.used_if(f, table):
                    value = f"{condition} ? {value} : {self.unused(f)}"
                if others:
                    value = f"[{', '.join(self.read(each) for each in [f, *others])}]"
                properties.append(f"  {name}," if f.name in deciding else f"  {name}: {value},")
            lines += ["return {", *properties, "};"]
        if table.is_struct:
            zero = f"new {kind}().__init(0, zeros)"
        else:
            zero = f"new {kind}().__init(4, absent)"
        return self.function(f"function read{table.name}(from: {kind} | null): {result}",
                             [f"const w = from ?? {zero};", *lines])

    # ---- building

    def check(self, f, value, at):
        """An expression that checks the value of a field, or of an entry of its list, and converts
        it to what is stored: an offset, a number, or the arguments of a struct."""
        table, enum = self.table_of(f), self.enum_of(f)
        if table is not None and table.is_struct:
            return f"arguments{f.type}({value}, {at})"
        if table is not None:
            return f"build{f.type}(b, {value}, {at})"
        if enum:
            return f"check.oneOf({value}, {at}, enums.{enum})"
        if f.type in ("string", "bool"):
            return f"check.{ {'string': 'text', 'bool': 'truth'}[f.type]}({value}, {at})"
        if f.type in ("ulong", "float", "double"):
            return f"check.{ {'ulong': 'long'}.get(f.type, 'real')}({value}, {at})"
        bits = 8 * SCALARS[f.type]
        low = -2 ** (bits - 1) if f.type == "short" else 0
        return f"check.integer({value}, {at}, {low}, {low + 2 ** bits - 1})"

    def build_value(self, f, table):
        name = self.name_of(f)
        at = f"at.of('{name}')"
        list_name = camel(f.name) + "Vector"
        inner = self.table_of(f)
        if self.is_parameters(f):
            value = f"list{f.type}({name})"
        elif f.is_list:
            value = f"check.list({name}, {at}, (value, entry) => {self.check(f, 'value', 'entry')})"
        else:
            value = self.check(f, name, at)
        if f.is_list and inner is not None and inner.is_struct:
            pack = f"({{pack: () => wire.{f.type}.create{f.type}(b, ...values)}})"
            value = (f"b.createStructOffsetList({value}.map((values) => {pack}), "
                     f"wire.{table.name}.start{list_name})")
        elif f.is_list:
            value = f"wire.{table.name}.create{list_name}(b, {value})"
        elif f.type == "string":
            shared = "Shared" if "shared" in f else ""
            value = f"b.create{shared}String({value})"
        if "optional" in f or f.default == "null":
            value = f"{name} === null ? null : {value}"
        if condition := self.used_if(f, table, unchecked=True):
            unused = f"check.unused({name}, {at}, {self.reason(f, table)})" if f.type == "bool" \
                else "null"
            value = f"{condition} ? {value} : {unused}"
        return value

    def reason(self, f, table):
        """Why a bool must not be true in a message that does not use it."""
        names = ", ".join(lower_camel(name) for name in f.get("only").split())
        reason = f"'is only allowed for the types {names}'"
        if other := f.get("without"):
            excluded = next(self.name_of(each) for each in table.fields if each.name == other)
            condition = self.is_one_of(f.get("only").split())
            reason = f"{condition} ? 'cannot be combined with {excluded}' : {reason}"
        return reason

    def absent(self, f):
        """The default value of a property that may be absent, or None. generator/README.md lists
        the cases."""
        if not (f.default or "only" in f or "optional" in f or f.type == "bool" or
                (f.is_list and "min" not in f)):
            return None
        return self.unused(f)

    def add(self, f, slot):
        value = f"{self.name_of(f)}Value"
        inner = self.table_of(f)
        nullable = "only" in f or "optional" in f or f.default == "null"
        if f.is_list or f.type == "string" or (inner is not None and not inner.is_struct):
            line = f"b.addFieldOffset({slot}, {value}, 0);"
        elif inner is not None:
            line = f"b.addFieldStruct({slot}, wire.{f.type}.create{f.type}(b, ...{value}), 0);"
        else:
            adder = ADDERS["ubyte" if self.enum_of(f) else f.type]
            # The builder does not store values that equal `initial`. NaN equals no number, so with
            # NaN every value is stored, even 0.
            initial = "NaN" if f.default == "null" else "0n" if f.type == "ulong" else \
                self.schema.enums[f.type].values[self.first_value(f)] if self.enum_of(f) else \
                f.default or 0
            stored = f"Number({'!' if 'inverted' in f else ''}{value})" if f.type == "bool" \
                else value
            line = f"b.addField{adder}({slot}, {stored}, {initial});"
        return f"if ({value} !== null) {line}" if nullable else line

    def build_function(self, table):
        if member := self.only_member(table):
            name = self.name_of(member)
            return self.function(
                f"function build{table.name}(b: Builder, {name}: unknown, at: check.Place): number",
                [f"const {name}Value = b.createString(check.text({name}, at));",
                 "b.startObject(1);", self.add(member, 0), "return b.endObject();"])
        defaults = [(self.name_of(f), self.absent(f)) for f in table.fields]
        names = ", ".join(name + (f" = {value}" if value else "") for name, value in defaults)
        lines = [f"const {{{names}}} = check.object(fields, at);"]
        lines += [f"const {self.name_of(f)}Value = {self.build_value(f, table)};"
                  for f in table.fields]
        lines.append(f"b.startObject({len(table.all_fields)});")
        lines += [self.add(f, slot) for slot, f in enumerate(table.all_fields)
                  if "deprecated" not in f]
        lines.append("return b.endObject();")
        return self.function(
            f"function build{table.name}(b: Builder, fields: unknown, at: check.Place): number",
            lines)

    def arguments_function(self, table):
        """Checks the members of a struct and returns the arguments of flatc's function."""
        lines = []
        if "web" in table:
            key, _ = self.key_and_value(table)
            number = f"enums.{key.get('keys')}.indexOf(name as never)"
            entry = ", ".join(number if f is key else "value" for f in table.fields)
            return ("/** Returns the arguments for each property of an object. */\n" +
                    self.function(f"function list{table.name}(value: unknown): [number, number][]",
                                  [f"return Object.entries(value as {table.get('web')}).map("
                                   f"([name, value]) => [{entry}]);"]))
        if self.is_tuple(table):
            count = len(table.fields)
            lines.append(f"const members = check.tuple(value, at, {count});")
            values = [self.check(f, f"members[{i}]", "at") for i, f in enumerate(table.fields)]
        else:
            properties = self.properties(table)
            lines.append(f"const {{{', '.join(properties)}}} = check.object(value, at);")
            values = []
            for name, fields in properties.items():
                at = f"at.of('{name}')"
                if len(fields) > 1:
                    lines.append(f"const {name}Values = check.tuple({name}, {at}, {len(fields)});")
                    values += [self.check(f, f"{name}Values[{i}]", at)
                               for i, f in enumerate(fields)]
                else:
                    values.append(("..." if self.table_of(fields[0]) else "") +
                                  self.check(fields[0], name, at))
        lines.append(f"return [{', '.join(values)}];")
        numbers = ", ".join(["number"] * self.number_count(table))
        return self.function(f"function arguments{table.name}(value: unknown, at: check.Place): "
                             f"[{numbers}]", lines)

    def number_count(self, table):
        return sum(self.number_count(self.table_of(f)) if self.table_of(f) else 1
                   for f in table.fields)

    # ---- files

    def codec(self):
        tables = self.schema.tables.values()
        functions = [self.read_function(t) for t in tables]
        functions += [self.arguments_function(t) if t.is_struct else self.build_function(t)
                      for t in tables]
        names = ", ".join(sorted(
            self.interface_name(t) for t in tables
            if not self.is_tuple(t) and "web" not in t and not self.only_member(t)))
        readers = "".join(f"  {m.get('message')}: (bytes: ByteBuffer) => "
                          f"read{m.name}(wire.{m.name}.getRootAs{m.name}(bytes)),\n"
                          for m in self.schema.messages)
        builders = "".join(f"  {m.name}: build{m.name},\n" for m in self.schema.messages)
        return (self.head() +
                "import {Builder, ByteBuffer, Encoding} from 'flatbuffers';\n"
                "import * as check from '../src/wire/check';\n"
                "import type {Parameters} from '../src/types';\n"
                "import {absent, text, zeros} from '../src/wire/support';\n"
                f"import {{enums, type Message, type {names.replace(', ', ', type ')}}} "
                "from './messages';\nimport * as wire from './wire';\n\n" + "\n".join(functions) +
                "\n/** Read the message that begins at the position of `bytes`, by its number. */\n"
                "export const readers: {[type: number]: (bytes: ByteBuffer) => Message} = "
                f"{{\n{readers}}};\n\n"
                "/** Check a message, and build its table. */\n"
                f"export const builders = {{\n{builders}}};\n")

    # ---- JSON of the test vectors

    def json_value(self, f, value):
        table, enum = self.table_of(f), self.enum_of(f)
        if table is not None and self.only_member(table):
            return value
        if table is not None and self.is_tuple(table):
            if f.get("json_array") == "" or "native" in table:
                return f"[...{value}]"
            members = ", ".join(f"{each.name}: {value}[{i}]" for i, each in enumerate(table.fields))
            return f"{{{members}}}"
        if table is not None:
            return f"json{f.type}({value})"
        if enum:
            return f"enums.{enum}.indexOf({value})"
        if "inverted" in f:
            return f"!{value}"
        return f"String({value})" if f.type == "ulong" else value

    def is_present(self, f, m, value):
        """The condition under which a field with the attribute `json_omit` is in the JSON."""
        if f.is_list:
            return f"{m}.length > 0"
        return f"{m} !== null" if "optional" in f or f.default == "null" else value

    def json_lines(self, table):
        properties = self.properties(table)
        for f in table.fields:
            if "borrowed" in f:  # The decoded poses in the JSON contain all borrowed lists.
                continue
            vector = self.vector_of(f)
            m = f"m.{vector}[{properties[vector].index(f)}]" if vector else f"m.{self.name_of(f)}"
            value = self.json_value(f, m)
            if "bytes" in f:
                value = f"Buffer.from({m}).toString('hex')"
            elif self.is_parameters(f):
                key, number = self.key_and_value(self.table_of(f))
                index = f"enums.{key.get('keys')}.indexOf(name as never)"
                value = (f"Object.entries({m}).map(([name, value]) => "
                         f"({{{key.name}: {index}, {number.name}: value}}))")
            elif f.is_list:
                value = f"Array.from({m}, (entry) => {self.json_value(f, 'entry')})"
            elif "optional" in f or f.default == "null":
                value = f"{m} === null ? null : {value}"
            if group := f.get("json_array"):
                line = f"json.{group} = [...(json.{group} ?? []), {value}];"
            else:
                line = f"json.{f.name} = {value};"
            conditions = [self.used_if(f, table, "m.")]
            if "json_omit" in f:
                other = f.get("json_omit")
                conditions.append(f"m.{lower_camel(other)} !== null" if other else
                                  self.is_present(f, m, value))
            condition = " && ".join(filter(None, conditions))
            yield f"if ({condition}) {line}" if condition else line

    def json(self):
        tables = [t for t in self.schema.tables.values()
                  if not self.is_tuple(t) and "web" not in t and not self.only_member(t)]
        names = ", ".join(sorted(self.interface_name(t) for t in tables))
        functions = "\n".join(self.function(
            f"function json{t.name}(m: {self.interface_name(t)}): Json",
            ["const json: Json = {};", *self.json_lines(t), "return json;"]) for t in tables)
        rows = "".join(f"  {m.name}: json{m.name},\n" for m in self.schema.messages)
        return (self.head() + "import type {Json} from '../test/support/to_json';\n"
                f"import {{enums, type {names.replace(', ', ', type ')}}} from './messages';\n\n" +
                functions + "\n/** Convert messages to the JSON of protocol/vectors. */\n"
                f"export const toFields = {{\n{rows}}};\n")
