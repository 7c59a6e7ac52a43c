#!/usr/bin/env python3
"""Tests of protocol/generator on small schemas: generator_test.py ROOT."""

import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))
sys.path.insert(0, str(ROOT / "protocol" / "generator"))

from cpp import Cpp  # noqa: E402
from cpp_json import CppJson  # noqa: E402
from schema import Schema, SchemaError  # noqa: E402
from typescript_codec import TypeScriptCodec  # noqa: E402

SMALL = """
namespace test;
attribute "max";
table Limits {
  /// Items per message.
  max_items: ulong = 65536;
}
/// Color of paint.
enum Color: ubyte { Red = 0,
  /// Not blue.
  Green = 1 }
struct Point { x: double; z: float; }
table Item {
  avatar: uint (nonzero);
  /// Walking speed.
  speed_m_s: double = null (min: "0");
}
// A comment; with a semicolon.
table Paint (message: "7", sender: "client", bulk) {
  seq: ulong (nonzero);
  old: uint (deprecated);
  color: Color;
  text: string (max: "16");
  items: [Item] (min: "1", max: "max_items");
  hidden: bool (cpp: "visible", inverted);
  place: Point;
}
"""


def read(text):
    return Schema("small.fbs", text)


class SchemaTest(unittest.TestCase):
    def test_reads_tables_structs_enums_and_limits(self):
        schema = read(SMALL)
        self.assertEqual([m.name for m in schema.messages], ["Paint"])
        self.assertEqual(schema.enums["Color"].values, {"Red": 0, "Green": 1})
        self.assertEqual(schema.limits["max_items"].doc, ["Items per message."])
        paint = schema.tables["Paint"]
        self.assertEqual([f.name for f in paint.fields],
                         ["seq", "color", "text", "items", "hidden", "place"])
        self.assertEqual(len(paint.all_fields), 7)
        self.assertTrue(paint.fields[3].is_list)
        self.assertEqual(paint.fields[3].attributes, {"min": "1", "max": "max_items"})

    def test_declares_the_attributes_for_flatc(self):
        text = "table A (bulk) { x: string (max: \"9\"); y: uint (deprecated); }"
        declared = read(text).for_flatc()
        for attribute in ("bulk", "max"):
            self.assertIn(f'attribute "{attribute}";\n', declared)
        self.assertNotIn('attribute "deprecated"', declared)  # flatc declares it.
        self.assertTrue(declared.endswith(text))

    def test_lays_out_structs_with_padding(self):
        schema = read(SMALL)
        self.assertEqual(schema.inline_layout("Point"), (16, 8))
        self.assertEqual(schema.inline_layout("Color"), (1, 1))
        self.assertIsNone(schema.inline_layout("Item"))

    def test_errors_name_file_line_and_field(self):
        cases = {
            "table A {\n  x: uint (nonzer);\n}": "small.fbs:2: A.x: unknown attribute 'nonzer'",
            "table A (masage: \"1\") { x: uint; }":
                "small.fbs:1: table A: unknown attribute 'masage'",
            "\n\ntable A { x: Missing; }": "small.fbs:3: A.x: unknown type 'Missing'",
            "table A {\n  x: [uint];\n}":
                "small.fbs:2: A.x: a list or text needs the attribute 'max'",
            "table A { x: string; }": "small.fbs:1: A.x: a list or text needs the attribute 'max'",
            "table A { x: uint (max: \"max_itms\"); }":
                "small.fbs:1: A.x: max: expected a number or a field of Limits, got 'max_itms'",
            "enum C: ubyte { Red = 0 }\ntable A { x: C (max: \"Blue\"); }":
                "small.fbs:2: A.x: max: C has no enumerator 'Blue'",
            "enum C: ubyte { Red = 1 }": "small.fbs:1: enum C: expected '0'",
            "enum C: int { Red = 0 }": "small.fbs:1: enum C: expected the type ubyte, got 'int'",
            "table A { x: uint }": "small.fbs:1: expected ';' after 'x: uint'",
            "table A { x = 4; }": "small.fbs:1: A: cannot read the field 'x = 4'",
            "union U { A, B }": "small.fbs:1: expected a table, struct or enum, got 'union U'",
            "table A {\n  x: [string] (max: \"2\");\n}": "small.fbs:2: A.x: lists of strings",
            "table A {\n  x: uint;": "small.fbs:2: the declaration does not end",
            "table A {\n  x: uint (below: \"y\");\n}": "small.fbs:2: A.x: below: expected a number",
            "table A {\n  x: uint (with: \"y\");\n}": "small.fbs:2: A.x: there is no field 'y'",
        }
        for text, expected in cases.items():
            with self.subTest(text), self.assertRaises(SchemaError) as raised:
                read(text)
            self.assertTrue(str(raised.exception).startswith(expected), str(raised.exception))


class CppTest(unittest.TestCase):
    def setUp(self):
        self.cpp = Cpp(read(SMALL))
        self.source = self.cpp.codec_source()

    def test_checks_every_field(self):
        for line in (
                'found.That(m.seq != 0, {&at, "seq"}, "expected a number other than 0");',
                'found.That(static_cast<unsigned>(m.color) <= 1, {&at, "color"}, '
                '"expected a number from 0 to 1", ErrorCode::kMalformed, '
                'static_cast<int>(m.color));',
                'found.Text(m.text, {0, 16, "expected at most 16 bytes"}, {&at, "text"});',
                'CheckList(found, m.items, {1, kMaxItems, "expected 1 to 65,536 entries"}, '
                '{&at, "items"});',
                'if (m.speed_m_s) found.That(std::isfinite(*m.speed_m_s) && *m.speed_m_s >= 0, '
                '{&at, "speed_m_s"}, "expected a number of at least 0");'):
            self.assertIn(line, self.source)

    def test_comments_state_ranges(self):
        header = self.cpp.structs_header()
        for line in ("  /// Not 0.\n  Seq seq = 0;\n", "  /// At most 16.\n  std::string text;\n",
                     "  /// 1 to kMaxItems entries.\n  std::vector<Item> items;\n",
                     "  /// Walking speed. At least 0.\n  std::optional<double> speed_m_s;\n"):
            self.assertIn(line, header)

    def test_checks_relations_between_fields(self):
        source = Cpp(read("""table Batch {
          part: ushort (below: "parts");
          parts: ushort;
          ids: [uint] (max: "4");
          flags: [ubyte] (per: "ids", max: "4");
          token: [ubyte] (bytes, min_or_none: "16", max: "64");
          place: Place (optional);
          moves: bool (requires: "place");
          exact: bool;
          near: bool (without: "exact");
        }
        table Place { x: double; }""")).codec_source()
        for line in (
                'm.part < m.parts, {&at, "part"}, "expected a number below parts", '
                'ErrorCode::kOutOfRange, m.part);',
                'm.flags.size() == m.ids.size(), {&at, "flags"}, "expected one entry per id", '
                'ErrorCode::kShapeMismatch, m.flags.size());',
                'm.token.empty() || m.token.size() >= 16, {&at, "token"}, '
                '"expected 16 to 64 bytes, or none", ErrorCode::kLimitExceeded, m.token.size());',
                '!m.moves || m.place, {&at, "moves"}, "moves requires a place", '
                'ErrorCode::kMalformed);',
                '!m.near || !m.exact, {&at, "exact"}, "exact excludes near", '
                'ErrorCode::kMalformed);'):
            self.assertIn("found.That(" + line, source)

    def test_checks_keys_and_counts(self):
        source = Cpp(read("""enum PaintName: ubyte { Red = 0, Green = 1 }
        struct Amount (web: "Amounts") { value: double; name: ubyte (keys: "PaintName"); }
        table Picture {
          amounts: [Amount] (max: "2");
          names: [ubyte] (keys: "PaintName", max: "2");
          rows: ushort;
          columns: ushort;
          dots_m: [float] (max: "9", count: "columns * rows");
        }""")).codec_source()
        texts = '2, "expected a paint name from 0 to 1", "a paint occurs twice", '
        for line in (
                'found.That(std::isfinite(m.value), at, "expected a finite number");',
                'found.Keys(m.amounts, &Amount::name, ' + texts + '{&at, "amounts"});',
                'found.Keys(m.names, std::identity{}, ' + texts + '{&at, "names"});',
                'found.That(m.dots_m.size() == std::size_t{1} * m.columns * m.rows, '
                '{&at, "dots_m"}, "expected columns * rows dots", ErrorCode::kShapeMismatch, '
                'm.dots_m.size());'):
            self.assertIn(line, source)

    def test_decodes_and_encodes_renamed_and_inverted_members(self):
        self.assertIn("m.visible = !w.hidden();", self.source)
        self.assertIn("return wire::CreatePaint(b, m.seq, static_cast<wire::Color>(m.color), text, "
                      "items, !m.visible, &place);", self.source)
        self.assertNotIn("old", self.source)

    def test_writes_limits_and_messages(self):
        self.assertIn("/// Items per message.\ninline constexpr std::size_t kMaxItems = 65536;",
                      self.cpp.limits_header())
        self.assertIn("kPaint = 7,", self.cpp.message_type_header())
        self.assertIn("/// Color of paint.\nenum class Color : std::uint8_t {\n  kRed = 0,\n"
                      "  /// Not blue.\n  kGreen = 1,\n};", self.cpp.message_type_header())
        self.assertIn("X(Paint, Paint, true, false, true)", self.cpp.message_list())

    def test_writes_structs(self):
        header = self.cpp.structs_header()
        for line in ("  AvatarId avatar = 0;\n", "  std::optional<double> speed_m_s;",
                     "  static constexpr MessageType kType = MessageType::kPaint;\n",
                     "  Seq seq = 0;",
                     "  Color color = Color::kRed;", "  std::vector<Item> items;",
                     "  bool visible = true;", "using Message = std::variant<Paint>;"):
            self.assertIn(line, header)

    def test_borrows_and_reverses_lists(self):
        cpp = Cpp(read("""table Batch (reversed) {
          ids: [uint] (borrowed, keep_empty, max: "4");
          bytes: [ubyte] (bytes, keep_empty: "ids", max: "9");
        }"""))
        self.assertIn("std::span<const std::uint32_t> ids;\n  /// At most 9.\n"
                      "  std::vector<std::byte> bytes;\n};",
                      cpp.structs_header())
        self.assertIn("found.Copy(w.ids(), {0, 4, ", cpp.codec_source())
        self.assertIn("const auto bytes = m.ids.empty() ? "
                      "Offset<flatbuffers::Vector<std::uint8_t>>() "
                      ": b.CreateVector(reinterpret_cast<const std::uint8_t*>(m.bytes.data()), "
                      "m.bytes.size());\n  const auto ids = b.CreateVector(", cpp.codec_source())

    def test_writes_structs_of_groups(self):
        header = Cpp(read("""table Spawn {
          /// Where it stands.
          x_m: double (cpp: "start.x_m", group: "Start");
          /// Not wrapped.
          heading_rad: double (cpp: "start.heading_rad");
        }
        table Moved { x_m: double (cpp: "to.x_m", group: "Start"); }""")).structs_header()
        self.assertEqual(header.count("/// Where it stands.\nstruct Start {\n  double x_m = 0.0;\n"
                                      "  /// Not wrapped.\n  double heading_rad = 0.0;\n"), 1)
        self.assertEqual(header.count("struct Start"), 1)
        self.assertIn("  Start to;", header)

    def test_writes_json(self):
        source = CppJson(read(SMALL + 'struct A { x: ubyte (json_array: "xy"); '
                              'y: ubyte (json_array: "xy"); }')).source()
        self.assertIn('json["xy"].push_back(m.x);\n  json["xy"].push_back(m.y);', source)
        self.assertIn('json.at("xy").at(1).get_to(m.y);', source)
        self.assertIn('json["seq"] = std::to_string(m.seq);', source)
        self.assertIn('json["hidden"] = !m.visible;', source)
        self.assertIn('m.visible = !json.value("hidden", false);', source)
        self.assertIn('Get(json, "speed_m_s", m.speed_m_s);', source)


VARIANT = """
struct Vec3 (native: "DVec3") { x: double; y: double; z: double; }
enum Kind: ubyte {
  /// A hop.
  Hop = 0,
  Run = 1
}
table Item (variant: "movement") {
  id: uint (nonzero);
  type: Kind;
  far: double (only: "Hop Run", without: "at");
  at: Vec3 (optional, only: "Run", json_omit);
  high: bool (only: "Hop", json_omit);
  seconds: double = null (only: "Run", needed: "Run");
}
table Ask (message: "7", sender: "client") { items: [Item] (max: "4"); }
"""


class VariantTest(unittest.TestCase):
    def test_writes_a_struct_per_type(self):
        header = Cpp(read(VARIANT)).structs_header()
        self.assertIn("/// A hop.\nstruct HopMovement {\n  double far = 0.0;\n"
                      "  bool high = false;\n", header)
        self.assertIn("struct RunMovement {\n  double far = 0.0;\n  std::optional<DVec3> at;\n"
                      "  double seconds = 0.0;\n", header)
        self.assertIn("struct Item {\n  /// Not 0.\n  std::uint32_t id = 0;\n"
                      "  /// The index of the alternative is a Kind.\n"
                      "  std::variant<HopMovement, RunMovement> movement;\n", header)

    def test_copies_only_fields_that_the_type_uses(self):
        source = Cpp(read(VARIANT)).codec_source()
        for line in ("  if (!m.at) found.That(std::isfinite(m.far), {&at, \"far\"}, "
                     "\"expected a finite number\");",
                     "  if (!w.at()) m.far = w.far();", "  m.high = w.high();",
                     "    case wire::Kind::Run: return Unpack(found, at, w, "
                     "m.movement.emplace<RunMovement>());",
                     "  if (!w.seconds()) {\n"
                     "    return found.Wrong(ErrorCode::kMalformed, \"a run requires seconds\", ",
                     "  m.seconds = *w.seconds();", "    if (!m.at) far = m.far;",
                     "    if (m.at) at = ToWire(*m.at);"):
            self.assertIn(line, source)

    def test_writes_json_of_the_used_fields(self):
        source = CppJson(read(VARIANT)).source()
        self.assertIn('  if (!m.at) json["far"] = m.far;\n'
                      '  if (m.at) json["at"] = m.at ? Json(*m.at) : Json();\n', source)
        self.assertIn("    case 1: json.get_to(m.movement.emplace<RunMovement>()); break;",
                      source)

    def test_web_client_reads_and_checks_only_used_fields(self):
        codec = TypeScriptCodec(read(VARIANT)).codec()
        for line in ("  far: (type === 'hop' || type === 'run') && !Boolean(at) ? w.far() : 0,",
                     "  const farValue = (type === 'hop' || type === 'run') && "
                     "!(Boolean(at) && type === 'run') ? check.real(far, at.of('far')) : null;",
                     "  if (farValue !== null) b.addFieldFloat64(2, farValue, 0);",
                     " : check.unused(high, at.of('high'), 'is only allowed for the types hop');"):
            self.assertIn(line, codec)

    def test_web_client_converts_only_used_fields_to_json(self):
        json = TypeScriptCodec(read(VARIANT)).json()
        self.assertIn("  if (m.type === 'hop' && m.high) json.high = m.high;", json)


class TypeScriptTest(unittest.TestCase):
    def setUp(self):
        self.web = TypeScriptCodec(read(SMALL))

    def test_writes_interfaces_with_the_names_of_cpp(self):
        messages = self.web.messages()
        for line in ("Color: ['red', 'green'],", "speedMS: number | null;", "visible: boolean;",
                     "color: Color;", "place: readonly [number, number];", "Paint: 7,",
                     "  /** 1 to 65536 entries. */\n  readonly items: readonly Item[];\n",
                     "/**\n * Color of paint.\n * - `green`: Not blue.\n */\nexport type Color"):
            self.assertIn(line, messages)
        self.assertNotIn("old", messages)

    def test_reads_and_builds_tables(self):
        codec = self.web.codec()
        for line in ("  color: enums.Color[w.color()]!,", "  visible: !w.hidden(),",
                     "  items: Array.from({length: w.itemsLength()}, "
                     "(_, i) => readItem(w.items(i))),",
                     "  speedMS: w.speedMS(),", "  place: readPoint(w.place()),",
                     "  const {seq, color, text, items, visible = true, place} = "
                     "check.object(fields, at);",
                     "  b.addFieldInt8(5, Number(!visibleValue), 0);",
                     "  if (speedMSValue !== null) b.addFieldFloat64(1, speedMSValue, NaN);",
                     "  b.addFieldStruct(6, wire.Point.createPoint(b, ...placeValue), 0);",
                     " = check.integer(avatar, at.of('avatar'), 0, 4294967295);"):
            self.assertIn(line, codec)
        self.assertNotIn("old", codec)

    def test_members_of_a_vector_are_an_array(self):
        web = TypeScriptCodec(read("""struct Box {
          /// Smallest x and z.
          min_x: double (cpp: "min_m.x", group: "GroundPoint");
          min_z: double (cpp: "min_m.z");
          height_m: double;
        }"""))
        self.assertIn("  /** Smallest x and z. */\n  readonly minM: readonly [number, number];\n",
                      web.messages())
        for line in ("  minM: [w.minX(), w.minZ()],",
                     "  const {minM, heightM} = check.object(value, at);",
                     "  const minMValues = check.tuple(minM, at.of('minM'), 2);",
                     "check.real(minMValues[1], at.of('minM')), check.real(heightM, "):
            self.assertIn(line, web.codec())
        self.assertIn("  json.min_z = m.minM[1];", web.json())

    def test_comments_have_the_names_of_properties(self):
        messages = TypeScriptCodec(read("""/// At most `far_m` away.
        table Ring { far_m: double (web: "radiusM"); }""")).messages()
        self.assertIn("/** At most `radiusM` away. */\nexport interface Ring", messages)


class StandardTest(unittest.TestCase):
    """STANDARD.md agrees with the schema."""

    def setUp(self):
        folder = ROOT / "protocol"
        self.schema = read((folder / "schema" / "stridewire.fbs").read_text(encoding="utf-8"))
        self.standard = (folder / "STANDARD.md").read_text(encoding="utf-8")

    def test_lists_all_messages(self):
        rows = re.findall(r"^\| (\d+) \| (\w+) \| (client|server|both) \| (\d+ [KM]iB) \|$",
                          self.standard, re.M)
        caps = {True: "16 MiB", False: "1 MiB"}
        expected = [(m.get("message"), m.name, m.get("sender"),
                     "16 KiB" if m.name == "Hello" else caps["bulk" in m])
                    for m in self.schema.messages]
        self.assertEqual(rows, expected)

    def test_describes_every_field(self):
        for table in self.schema.tables.values():
            if table.name in ("RotationQuantization", "Vec3", "Offset", "Rotation",
                              "ParameterValue", "GroundPoint"):
                continue
            for f in table.all_fields:
                with self.subTest(table=table.name, field=f.name):
                    self.assertRegex(self.standard, rf"`(\w+\.)*{f.name}`")


if __name__ == "__main__":
    unittest.main(verbosity=1)
