"""Writes the C++ code of the protocol: limits, message structs, checks, decoding and encoding."""

import re
from dataclasses import replace

HEAD = "// Generated from {schema} by protocol/generator. Do not edit.\n"
# Type aliases of message_parts.h, by the name of the field.
ALIASES = {"seq": "Seq", "last_seq": "Seq", "world": "WorldId", "avatar": "AvatarId",
           "avatars": "AvatarId", "subscription": "SubscriptionId", "request_id": "RequestId"}
CPP_TYPES = {"bool": "bool", "string": "std::string", "ubyte": "std::uint8_t",
             "short": "std::int16_t", "ushort": "std::uint16_t", "uint": "std::uint32_t",
             "ulong": "std::uint64_t", "float": "float", "double": "double"}
CPP_INTEGERS = {"ubyte": "std::uint8_t", "ushort": "std::uint16_t", "uint": "std::uint32_t",
                "ulong": "std::size_t", "int": "int"}


def camel(name):
    """max_items -> MaxItems"""
    return "".join(word.capitalize() for word in name.split("_"))


def grouped(number):
    """Formats a bound for an error text: 65536 -> 65,536."""
    return f"{int(number):,}" if number == int(number) else str(number)


class Cpp:
    def __init__(self, schema):
        self.schema = schema

    # ---- names and expressions

    def type_name(self, type_name):
        """The C++ type of the message structs for a table, struct or enum."""
        declared = self.schema.tables.get(type_name) or self.schema.enums.get(type_name)
        if declared is None:  # An alternative of a variant is not declared in the schema.
            return type_name
        return declared.attributes.get("native") or declared.attributes.get("cpp") or type_name

    def member(self, f):
        path = f.get("cpp", f.name)
        return "m" if path == "." else f"m.{path}"

    def bound(self, value):
        return f"k{camel(value)}" if value in self.schema.limits else value

    def text_of(self, value):
        return grouped(self.schema.number(value))

    def bounds(self, f):
        """Bounds of the length of a list or text, with the text of the error."""
        unit = "bytes" if f.type == "string" or "bytes" in f else "entries"
        low = f.get("min", "0")
        expected = (f"expected {self.text_of(low)} to " if low != "0" else "expected at most ")
        expected += f"{self.text_of(f.get('max'))} {unit}"
        return f'{{{self.bound(low)}, {self.bound(f.get("max"))}, "{expected}"}}'

    def at(self, f):
        return "at" if f.get("cpp") == "." else f'{{&at, "{f.name}"}}'

    def is_float(self, f):
        return f.type in ("float", "double")

    def used_if(self, f, path):
        """The condition under which a field is used: "if (!m.at_m) ", or nothing. `path` formats
        the name of the other field."""
        if other := f.get("with"):
            return f"if ({path.format(other)}) "
        if other := f.get("without"):
            return f"if (!{path.format(other)}) "
        return ""

    def common_fields(self, table):
        """The fields that every alternative of a table uses, without `type`."""
        return [f for f in table.fields if "only" not in f and f.name != "type"]

    def variant(self, table):
        return f"m.{table.get('variant')}"

    # ---- checks

    def that(self, condition, at, text, code="OutOfRange", value=None):
        """A check of one value. The error contains `value`, an integer, unless it is None."""
        more = f", ErrorCode::k{code}" if value is not None or code != "OutOfRange" else ""
        more += f", {value}" if value is not None else ""
        return f'found.That({condition}, {at}, "{text}"{more});'

    def known(self, value, last, at):
        """A check that a number belongs to an enum."""
        return self.that(f"static_cast<unsigned>({value}) <= {last}", at,
                         f"expected a number from 0 to {last}", "Malformed",
                         f"static_cast<int>({value})")

    def number_check(self, f, value):
        at = self.at(f)
        if f.type in self.schema.enums:
            last = f.get("max") or list(self.schema.enums[f.type].values)[-1]
            return self.known(value, self.schema.enums[f.type].values[last], at)
        if "nonzero" in f:
            return self.that(f"{value} != 0", at, "expected a number other than 0")
        above, below, low, high = (
            value if value and self.schema.is_constant(value) else None
            for value in (f.get(name) for name in ("above", "below", "min", "max")))
        if self.is_float(f):
            condition, text = f"std::isfinite({value})", "expected a finite number"
            if above is not None:
                condition += f" && {value} > {above}"
                text = f"expected a number above {above}"
            elif low is not None:
                condition += f" && {value} >= {low}"
                text = f"expected a number of at least {low}"
            return self.that(condition, at, text)
        if low is not None and high is not None:
            return self.that(f"{value} >= {self.bound(low)} && {value} <= {self.bound(high)}", at,
                             f"expected {self.text_of(low)} to {self.text_of(high)}", value=value)
        for value_of, sign, words in ((low, ">=", "at least"), (high, "<=", "at most"),
                                      (below, "<", "a number below")):
            if value_of is not None:
                return self.that(f"{value} {sign} {self.bound(value_of)}", at,
                                 f"expected {words} {self.text_of(value_of)}", value=value)
        return None

    def entries_check(self, f, condition, text, code="OutOfRange"):
        return (f'found.Entries({self.member(f)}, [](auto entry) {{ return {condition}; }}, '
                f'ErrorCode::k{code}, "{text}", {self.at(f)});')

    def keys_check(self, f, key):
        """A check that the numbers `key` of a list are different values of an enum."""
        enum = self.schema.enums[key.get("keys")]
        words = re.sub(r"(?<!^)(?=[A-Z])", " ", enum.name).lower()
        number = f"&{self.type_name(f.type)}::{key.name}" if f is not key else "std::identity{}"
        return (f"found.Keys({self.member(f)}, {number}, {len(enum.values)}, "
                f'"expected a {words} from 0 to {len(enum.values) - 1}", '
                f'"a {words.removesuffix(" name")} occurs twice", {self.at(f)});')

    def check(self, f):
        m, at = self.member(f), self.at(f)
        if f.is_list:
            keys = [self.keys_check(f, key) for key in self.schema.keys(f)]
            if f.type in self.schema.tables:
                return [f"CheckList(found, {m}, {self.bounds(f)}, {at});", *keys]
            lines = [f"found.Count({m}.size(), {self.bounds(f)}, {at});"]
            if self.is_float(f):
                lines.append(self.entries_check(f, "std::isfinite(entry)",
                                                "expected a finite number"))
            if "nonzero" in f:
                lines.append(self.entries_check(f, "entry != 0", "expected a number other than 0"))
            if enum := f.get("enumerators"):
                last = len(self.schema.enums[enum].values) - 1
                lines.append(self.entries_check(f, f"static_cast<unsigned>(entry) <= {last}",
                                                f"expected numbers from 0 to {last}", "Malformed"))
            return lines + keys
        if f.type == "string":
            return [f"found.Text({m}, {self.bounds(f)}, {at});"]
        if f.type in self.schema.tables:
            if "optional" in f:
                return [f"if ({m}) CheckFields(found, {at}, *{m});"]
            return [f"CheckFields(found, {at}, {m});"]
        if f.default == "null":
            return [f"if ({m}) {self.number_check(f, '*' + m)}"]
        line = None if f.type == "bool" or "status" in f else self.number_check(f, m)
        return [line] if line else []

    def relations(self, f, table):
        """Checks of a field that depend on other fields of the table."""
        fields = {each.name: each for each in table.fields}
        m, at, lines = self.member(f), self.at(f), []
        for bound, sign, words in (("max", "<=", "at most"), ("below", "<", "a number below")):
            if other := fields.get(f.get(bound)):
                lines.append(self.that(f"{m} {sign} {self.member(other)}", at,
                                       f"expected {words} {other.name}", value=m))
        if low := f.get("min_or_none"):
            expected = (f"expected {self.text_of(low)} to {self.text_of(f.get('max'))} bytes, "
                        "or none")
            lines.append(self.that(f"{m}.empty() || {m}.size() >= {self.bound(low)}", at, expected,
                                   "LimitExceeded", f"{m}.size()"))
        if other := fields.get(f.get("per")):
            lines.append(self.that(f"{m}.size() == {self.member(other)}.size()", at,
                                   f"expected one entry per {other.name[:-1]}", "ShapeMismatch",
                                   f"{m}.size()"))
        if count := f.get("count"):
            product = " * ".join(self.member(fields[name]) for name in count.split(" * "))
            lines.append(self.that(f"{m}.size() == std::size_t{{1}} * {product}", at,
                                   f"expected {count} {re.sub('_m$', '', f.name)}",
                                   "ShapeMismatch", f"{m}.size()"))
        if other := fields.get(f.get("requires")):
            lines.append(self.that(f"!{m} || {self.member(other)}", at,
                                   f"{f.name} requires a {other.name}", "Malformed"))
        other = fields.get(f.get("without"))
        if other is not None and f.type == other.type == "bool":
            lines.append(self.that(f"!{m} || !{self.member(other)}", self.at(other),
                                   f"{other.name} excludes {f.get('cpp', f.name)}", "Malformed"))
        return lines

    def check_function(self, table):
        fields = self.common_fields(table) if "variant" in table else table.fields
        lines = [self.used_if(f, "m.{}") + line for f in fields for line in self.check(f)]
        lines += [line for f in fields for line in self.relations(f, table)]
        if "native" in table or "web" in table:
            finite = " && ".join(f"std::isfinite({self.member(f)})" for f in fields
                                 if self.is_float(f))
            lines = [self.that(finite, "at", "expected a finite number")]
        if "variant" in table:
            lines.append("std::visit([&](const auto& used) { CheckFields(found, at, used); }, "
                         f"{self.variant(table)});")
        if "meaning" in table:
            lines.append("if (found.ok()) CheckMeaning(found, at, m);")
        return self.function(f"void CheckFields(Findings& found, const FieldPath& at, "
                             f"const {self.type_name(table.name)}& m)", lines)

    # ---- decoding

    def unpack(self, f, in_struct):
        m, at, w = self.member(f), self.at(f), f"w.{f.name}()"
        if f.is_list:
            unpack = "UnpackList(found, " if f.type in self.schema.tables else "found.Copy("
            return f"{unpack}{w}, {self.bounds(f)}, {at}, {m});"
        if f.type == "string":
            return f"found.Copy({w}, {self.bounds(f)}, {at}, {m});"
        if f.type in self.schema.tables:
            if in_struct:
                return f"Unpack(found, {at}, {w}, {m});"
            target = f"{m}.emplace()" if "optional" in f else m
            return f"if (const auto* from = {w}) Unpack(found, {at}, *from, {target});"
        if "inverted" in f:
            return f"{m} = !{w};"
        if f.type in self.schema.enums:
            return f"{m} = static_cast<{self.type_name(f.type)}>({w});"
        if f.get("needed") and f.default is None:
            return f"{m} = *{w};"
        return f"{m} = static_cast<StatusCode>({w});" if "status" in f else f"{m} = {w};"

    def unpack_lines(self, table):
        fields = self.common_fields(table) if "variant" in table else table.fields
        return [self.used_if(f, "w.{}()") + self.unpack(f, table.is_struct) for f in fields]

    def unpack_function(self, table, lines, struct=None):
        return self.function(f"void Unpack([[maybe_unused]] Findings& found, "
                             f"[[maybe_unused]] const FieldPath& at, const wire::{table.name}& w, "
                             f"{self.type_name(struct or table.name)}& m)", lines)

    def unpack_functions(self, table):
        if "variant" not in table:
            return [self.unpack_function(table, self.unpack_lines(table))]
        enum = self.schema.enums[next(f.type for f in table.fields if f.name == "type")]
        functions, cases = [], []
        for value, alternative in zip(enum.values, self.schema.alternatives(table)):
            lines = self.unpack_lines(alternative)
            needed = [f for f in alternative.fields if value in f.get("needed", "").split()]
            if needed:
                absent = " || ".join(f"!w.{f.name}()" for f in needed)
                names = " and ".join(f.name for f in needed)
                lines = [f"if ({absent}) {{",
                         f'  return found.Wrong(ErrorCode::kMalformed, "a {value.lower()} requires '
                         f'{names}", {{&at, "type"}});', "}"] + lines
            functions.append(self.unpack_function(table, lines, alternative.name))
            cases.append(f"  case wire::{enum.name}::{value}: return Unpack(found, at, w, "
                         f"{self.variant(table)}.emplace<{alternative.name}>());")
        last = len(cases) - 1
        lines = self.unpack_lines(table) + ["switch (w.type()) {", *cases, "}"]
        lines.append(self.known("w.type()", last, '{&at, "type"}'))
        return functions + [self.unpack_function(table, lines)]

    # ---- encoding

    def wire_scalar(self, f):
        m = self.member(f)
        if f.type in self.schema.enums:
            return f"static_cast<wire::{f.type}>({m})"
        if "status" in f:
            return f"static_cast<std::uint16_t>({m})"
        return f"!{m}" if "inverted" in f else m

    def build_early(self, f):
        m = self.member(f)
        if f.is_list:
            return (f"std::vector<Offset<wire::{f.type}>> {f.name}_entries;\n"
                    f"  for (const auto& entry : {m}) "
                    f"{f.name}_entries.push_back(Build(b, entry));")
        return f"const auto {f.name} = Build(b, {m});"

    def list_offset(self, f):
        """The type of the offset of a list."""
        entry = CPP_TYPES.get(f.type) or f"Offset<wire::{f.type}>"
        entry = f"const wire::{f.type}*" if self.schema.is_struct(f.type) else entry
        return f"Offset<flatbuffers::Vector<{entry}>>"

    def build_list(self, f):
        m = self.member(f)
        if self.schema.is_struct(f.type):
            return f"b.CreateVectorOfNativeStructs<wire::{f.type}>({m}, ToWire)"
        if f.type in self.schema.tables:
            return f"b.CreateVector({f.name}_entries)" if "early" in f else \
                (f"b.CreateVector<Offset<wire::{f.type}>>({m}.size(), "
                 f"[&](std::size_t i) {{ return Build(b, {m}[i]); }})")
        numbers = f"reinterpret_cast<const {CPP_TYPES[f.type]}*>({m}.data())"
        return f"b.CreateVector({numbers}, {m}.size())"

    def build(self, f):
        """A statement that builds a struct, or a field that is stored by offset. Else None."""
        m = self.member(f)
        if f.is_list:
            value = self.build_list(f)
            if "keep_empty" not in f or f.get("keep_empty"):
                empty = f"m.{f.get('keep_empty')}" if f.get("keep_empty") else m
                value = f"{empty}.empty() ? {self.list_offset(f)}() : {value}"
            return f"const auto {f.name} = {value};"
        if f.type == "string":
            create = "CreateSharedString" if "shared" in f else "CreateString"
            return (f"const auto {f.name} = {m}.empty() ? Offset<flatbuffers::String>() "
                    f": b.{create}({m});")
        if f.type in self.schema.tables:
            if self.schema.is_struct(f.type):
                return f"const wire::{f.type} {f.name} = ToWire({m});"
            if "early" in f:
                return None
            if "optional" in f:
                return f"const auto {f.name} = {m} ? Build(b, *{m}) : Offset<wire::{f.type}>();"
            return self.build_early(f)
        return None

    def argument(self, f):
        if f.is_list or f.type == "string":
            return f.name
        if self.schema.is_struct(f.type):
            if "omit_zero" in f:
                return f"{self.member(f)} == {self.type_name(f.type)}(0.0) ? nullptr : &{f.name}"
            return f"&{f.name}"
        return f.name if f.type in self.schema.tables else self.wire_scalar(f)

    def variant_build_function(self, table):
        """Collects the values that the alternative uses, and then builds the table."""
        declared, arguments = {}, ["b"]
        for f in table.fields:
            m = self.member(f)
            if f.name == "type":
                arguments.append(f"static_cast<wire::{f.type}>({self.variant(table)}.index())")
            elif "only" not in f:
                arguments.append(self.argument(f))
            elif f.is_list:
                declared[f.name] = f"{self.list_offset(f)} {f.name};"
                arguments.append(f.name)
            elif self.schema.is_struct(f.type):
                declared[f.name] = f"std::optional<wire::{f.type}> {f.name};"
                arguments.append(f"{f.name} ? &*{f.name} : nullptr")
            else:
                kind = f"wire::{f.type}" if f.type in self.schema.enums else CPP_TYPES[f.type]
                kind = f"std::optional<{kind}>" if f.default == "null" else kind
                declared[f.name] = f"{kind} {f.name}{{}};"
                arguments.append(f.name)
        lines = list(declared.values())
        for alternative in self.schema.alternatives(table):
            lines.append(f"if (const auto* used = std::get_if<{alternative.name}>"
                         f"(&item.{table.get('variant')})) {{")
            lines.append(f"  const {alternative.name}& m = *used;")
            for f in alternative.fields:
                value = self.wire_scalar(f)
                condition = self.used_if(f, "m.{}")
                if f.is_list:
                    value = self.build_list(f)
                    condition = f"if (!{self.member(f)}.empty()) "
                elif self.schema.is_struct(f.type):
                    value = f"ToWire({'*' if 'optional' in f else ''}{self.member(f)})"
                    condition = f"if ({self.member(f)}) " if "optional" in f else condition
                lines.append(f"  {condition}{f.name} = {value};")
            lines.append("}")
        lines.append(f"const {self.type_name(table.name)}& m = item;")
        lines.append(f"return wire::Create{table.name}({', '.join(arguments)});")
        return self.function(self.build_signature(table, "item"), lines)

    def build_function(self, table):
        if "variant" in table:
            return self.variant_build_function(table)
        lines = [self.build_early(f) for f in table.fields if "early" in f]
        fields = reversed(table.fields) if "reversed" in table else table.fields
        lines += [line for f in fields if (line := self.build(f))]
        if "in_order" in table:
            lines.append(f"wire::{table.name}Builder builder(b);")
            for f in table.fields:
                condition = f"if ({self.member(f)}) " if f.default == "null" else ""
                value = "*" + self.member(f) if condition else self.argument(f)
                lines.append(f"{condition}builder.add_{f.name}({value});")
            lines.append("return builder.Finish();")
        else:
            arguments = ", ".join(["b"] + [self.argument(f) for f in table.fields])
            lines.append(f"return wire::Create{table.name}({arguments});")
        return self.function(self.build_signature(table), lines)

    def build_signature(self, table, name="m"):
        argument = f"const {self.type_name(table.name)}& {name}"
        if table.is_struct:
            return f"wire::{table.name} ToWire({argument})"
        return f"Offset<wire::{table.name}> Build(FlatBufferBuilder& b, {argument})"

    def to_wire_function(self, table):
        arguments = ", ".join(f"ToWire({self.member(f)})" if f.type in self.schema.tables
                              else self.wire_scalar(f) for f in table.fields)
        return self.function(self.build_signature(table), [f"return {{{arguments}}};"])

    # ---- files

    def function(self, signature, lines):
        body = "".join(f"  {line}\n" for line in lines)
        return f"{signature} {{\n{body}}}\n"

    def head(self):
        return HEAD.format(schema=self.schema.path)

    def limits_header(self):
        lines = []
        for f in self.schema.limits.values():
            lines += [f"/// {line}" for line in f.doc]
            lines.append(f"inline constexpr {CPP_INTEGERS[f.type]} k{camel(f.name)} = {f.default};")
        return (self.head() + "#pragma once\n\n#include <cstddef>\n#include <cstdint>\n\n"
                "namespace stridewire::protocol {\n\n" + "\n".join(lines) +
                "\n\n}  // namespace stridewire::protocol\n")

    def message_type_header(self):
        values = "".join(f"  k{m.name} = {m.get('message')},\n" for m in self.schema.messages)
        enums = "\n".join(self.enum(e) for e in self.schema.enums.values()
                          if "handwritten" not in e.attributes)
        return (self.head() + "#pragma once\n\n#include <cstdint>\n\n"
                "namespace stridewire::protocol {\n\n"
                "/// Message types in the frame header. Numbers are never reused.\n"
                f"enum class MessageType : std::uint16_t {{\n{values}}};\n\n{enums}\n"
                "}  // namespace stridewire::protocol\n")

    # ---- message structs

    def member_type(self, f):
        if f.name in ALIASES and f.type in ("uint", "ulong"):
            name = ALIASES[f.name]
        elif f.get("enumerators") or f.type in self.schema.enums or f.type in self.schema.tables:
            name = self.type_name(f.get("enumerators") or f.type)
        elif "status" in f or "bytes" in f:
            name = "StatusCode" if "status" in f else "std::byte"
        else:
            name = CPP_TYPES[f.type]
        if f.is_list:
            return f"std::span<const {name}>" if "borrowed" in f else f"std::vector<{name}>"
        is_optional = f.default == "null" or "optional" in f
        return f"std::optional<{name}>" if is_optional else name

    def initializer(self, f, type_name):
        if "initial" in f:
            return f" = {f.get('initial')}"
        if f.is_list or f.type == "string" or type_name.startswith("std::optional"):
            return ""
        if f.type in self.schema.enums:
            return f" = {type_name}::k{next(iter(self.schema.enums[f.type].values))}"
        if f.type in self.schema.tables:
            zero = {"DVec3": "0.0", "Vec3": "0.0f"}.get(type_name)
            return f" = {type_name}({zero})" if zero else ""
        if f.type == "bool":
            return " = true" if "inverted" in f else " = false"
        if "status" in f:
            return " = StatusCode::kOk"
        return f" = {f.default or ('0.0' if self.is_float(f) else '0')}"

    def struct(self, table):
        lines = [f"/// {line}" for line in table.doc] + [f"struct {self.type_name(table.name)} {{"]
        if "message" in table:
            lines.append(f"  static constexpr MessageType kType = MessageType::k{table.name};")
        if "variant" in table:
            return "\n".join(lines + self.variant_members(table)) + "\n"
        groups = {}  # Name of a member: number of its fields, for example legs[0] and legs[1].
        for f in table.fields:
            name = re.split(r"[.\[]", f.get("cpp", f.name))[0]
            groups[name] = groups.get(name, 0) + 1
            if groups[name] > 1:
                continue
            lines += [f"  /// {line}" for line in self.schema.documentation(f)]
            if "[" in f.get("cpp", ""):
                size = sum(other.get("cpp", "").startswith(f"{name}[") for other in table.fields)
                lines.append(f"  std::array<{self.member_type(f)}, {size}> {name};")
            elif "group" in f:
                lines.append(f"  {f.get('group')} {name};")
            else:
                type_name = self.member_type(f)
                lines.append(f"  {type_name} {name}{self.initializer(f, type_name)};")
        return "\n".join(lines + self.struct_end(table)) + "\n"

    def groups(self, table):
        """The fields of each member with the attribute `group`, with paths inside this member."""
        groups = {}
        for f in table.fields:
            name, _, path = f.get("cpp", "").partition(".")
            if path:
                groups.setdefault(name, []).append(
                    replace(f, attributes={**f.attributes, "cpp": path}))
        return {fields[0].get("group"): fields for fields in groups.values()}

    def group_struct(self, name, fields):
        """The comment of the first field describes the whole struct."""
        lines = [f"/// {line}" for line in fields[0].doc] + [f"struct {name} {{"]
        for i, f in enumerate(fields):
            lines += [f"  /// {line}" for line in self.schema.documentation(f) if i > 0]
            type_name = self.member_type(f)
            lines.append(f"  {type_name} {f.get('cpp')}{self.initializer(f, type_name)};")
        equal = f"bool operator==(const {name}&) const = default;"
        return "\n".join(lines + [f"  {equal}", "};"]) + "\n"

    def struct_end(self, table):
        if any("borrowed" in f for f in table.fields):
            return ["};"]
        equal = f"bool operator==(const {self.type_name(table.name)}&) const = default;"
        return [f"  {equal}", "};"]

    def variant_members(self, table):
        lines = []
        names = ", ".join(alternative.name for alternative in self.schema.alternatives(table))
        for f in table.fields:
            if f.name == "type":
                lines.append(f"  /// The index of the alternative is a {f.type}.")
                lines.append(f"  std::variant<{names}> {table.get('variant')};")
            elif "only" not in f:
                lines += [f"  /// {line}" for line in self.schema.documentation(f)]
                type_name = self.member_type(f)
                lines.append(f"  {type_name} {f.name}{self.initializer(f, type_name)};")
        return lines + self.struct_end(table)

    def enum(self, enum):
        lines = [f"/// {line}" for line in enum.doc]
        lines.append(f"enum class {self.type_name(enum.name)} : std::uint8_t {{")
        for name, number in enum.values.items():
            lines += [f"  /// {line}" for line in enum.value_docs[name]]
            lines.append(f"  k{name} = {number},")
        return "\n".join(lines + ["};"]) + "\n"

    def in_order_of_use(self):
        """Tables whose structs are generated, each after those that it contains."""
        done = []

        def add(table):
            if table in done or "native" in table or "handwritten" in table:
                return
            for f in table.fields:
                if f.type in self.schema.tables:
                    add(self.schema.tables[f.type])
            if "variant" in table:
                done.extend(self.schema.alternatives(table))
            done.append(table)

        for table in self.schema.tables.values():
            add(table)
        return done

    def structs_header(self):
        structs, done = [], set(self.schema.tables)
        for table in self.in_order_of_use():
            for name, fields in self.groups(table).items():
                if name not in done:
                    structs.append(self.group_struct(name, fields))
                    done.add(name)
            structs.append(self.struct(table))
        alternatives = ", ".join(self.type_name(m.name) for m in self.schema.messages)
        system = "".join(f"#include <{name}>\n" for name in (
            "array", "cstddef", "cstdint", "optional", "span", "string", "variant", "vector"))
        own = "".join(f'#include "stridewire/{name}.h"\n' for name in (
            "base/error", "base/math", "base/rotation_quantization", "protocol/frame",
            "protocol/message_parts", "protocol/pose_codec", "protocol/status_code"))
        return (self.head() + f"#pragma once\n\n{system}\n{own}\n"
                "namespace stridewire::protocol {\n\n" +
                "\n".join(structs) +
                f"\n/// Any message.\nusing Message = std::variant<{alternatives}>;\n"
                "\n}  // namespace stridewire::protocol\n")

    def message_list(self):
        """An X macro over all messages: struct, name on the wire, senders, whether it is bulk."""
        rows = " \\\n".join(
            f"  X({self.type_name(m.name)}, {m.name}, {str(m.get('sender') != 'server').lower()}, "
            f"{str(m.get('sender') != 'client').lower()}, {str('bulk' in m).lower()})"
            for m in self.schema.messages)
        return (self.head() + "#pragma once\n\n"
                "// X(struct, name, the client sends it, the server sends it, it is bulk)\n"
                f"#define STRIDEWIRE_MESSAGES(X) \\\n{rows}\n")

    def codec_header(self):
        lines = []
        for t in self.schema.tables.values():
            name = self.type_name(t.name)
            for alternative in self.schema.alternatives(t) if "variant" in t else []:
                lines.append("void CheckFields(Findings& found, const FieldPath& at, "
                             f"const {alternative.name}& m);")
            checks = ["CheckFields", "CheckMeaning"] if "meaning" in t else ["CheckFields"]
            lines += [f"void {check}(Findings& found, const FieldPath& at, const {name}& m);"
                      for check in checks]
            lines += [f"void Unpack(Findings& found, const FieldPath& at, const wire::{t.name}& w, "
                      f"{name}& m);", f"[[nodiscard]] {self.build_signature(t)};"]
        return (self.head() + '#pragma once\n\n#include "findings.h"\n'
                '#include "stridewire/protocol/messages.h"\n#include "stridewire_generated.h"\n\n'
                "namespace stridewire::protocol {\n\nusing flatbuffers::FlatBufferBuilder;\n"
                "using flatbuffers::Offset;\n\n" +
                "\n".join(lines) + "\n\n}  // namespace stridewire::protocol\n")

    def codec_source(self):
        parts = []
        for t in self.schema.tables.values():
            if "variant" in t:
                parts += [self.check_function(each) for each in self.schema.alternatives(t)]
            parts.append(self.check_function(t))
            parts += self.unpack_functions(t)
            parts.append(self.to_wire_function(t) if t.is_struct else self.build_function(t))
        return (self.head() + '#include "codec_support.h"\n\nnamespace stridewire::protocol {\n\n' +
                "\n".join(parts) + "\n}  // namespace stridewire::protocol\n")
