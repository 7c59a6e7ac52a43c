#include "offline/capture/bvh_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <unordered_set>

#include "base/check.h"
#include "offline/base/utf8.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {
namespace {

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
char Lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool EqualsWord(std::string_view a, std::string_view lower_word) {
  return a.size() == lower_word.size() && std::equal(a.begin(), a.end(), lower_word.begin(),
                                                     [](char x, char y) { return Lower(x) == y; });
}

bool StartsWithWord(std::string_view a, std::string_view lower_word) {
  return a.size() >= lower_word.size() && EqualsWord(a.substr(0, lower_word.size()), lower_word);
}

enum class NumberFault { kNone, kNotANumber, kTooLarge, kMixedPoint };

static_assert(kMaxBvhNumber == 1e7 && kMaxBvhNameBytes == 256);
constexpr const char* kTooLargeText = "expected a finite number from -1e7 to 1e7";
constexpr const char* kMixedPointText =
    "expected a number with the same decimal mark as the others; the file mixes commas and points";
constexpr const char* kFewerNumbersText = "the frame has fewer numbers than channels";
constexpr int kMaxChannels = 9;
constexpr std::size_t kMaxNumberBytes = 64;  // Maximum length of a number with a decimal comma.

// Parses a finite number within kMaxBvhNumber. Values too small for a double become zero.
NumberFault ParseNumber(std::string_view token, double& value) {
  std::string_view digits = token;
  if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty() || end != digits.data() + digits.size()) return NumberFault::kNotANumber;
  if (code == std::errc::result_out_of_range) {
    value = std::strtod(std::string(digits).c_str(), nullptr);
    if (std::fabs(value) < 1.0) value = 0.0;
  } else if (code != std::errc()) {
    return NumberFault::kNotANumber;
  }
  return std::fabs(value) <= kMaxBvhNumber ? NumberFault::kNone : NumberFault::kTooLarge;
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Returns true if the text contains a number with a decimal point.
bool HasDecimalPoint(std::string_view text) {
  for (std::size_t at = text.find('.'); at != std::string_view::npos; at = text.find('.', at + 1)) {
    const char before = at == 0 ? ' ' : text[at - 1];
    const bool starts = IsDigit(before) || before == '-' || before == '+' || IsSpace(before);
    if (starts && at + 1 < text.size() && IsDigit(text[at + 1])) return true;
  }
  return false;
}

// Joint names are written to reports and other files, which are UTF-8.
bool IsUtf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = Utf8SequenceLength(text, i);
    if (length == 0) return false;
    i += length;
  }
  return true;
}

// Returns one unit of the last digit: 1e-7 for ".0083333", 1e-8 for "8.33333e-03".
double LastDigit(std::string_view token) {
  const std::size_t e = token.find_first_of("eE");
  const std::string_view mantissa = token.substr(0, e);
  const std::size_t point = mantissa.find('.');
  int exponent =
      point == std::string_view::npos ? 0 : -static_cast<int>(mantissa.size() - point - 1);
  if (e != std::string_view::npos) {
    int power = 0;
    std::string_view text = token.substr(e + 1);
    if (!text.empty() && text.front() == '+') text.remove_prefix(1);
    if (std::from_chars(text.data(), text.data() + text.size(), power).ec == std::errc()) {
      exponent += std::clamp(power, -400, 400);
    }
  }
  return std::pow(10.0, std::max(exponent, -400));
}

class Parser {
 public:
  Parser(std::string_view text, std::string_view name) : text_(text), name_(name) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);  // UTF-8 byte order mark
  }

  Expected<BvhFile> Run() {
    if (text_.starts_with("\xFF\xFE") || text_.starts_with("\xFE\xFF")) {
      return FailAt(1, ErrorCode::kMalformed, "the file is UTF-16 text; save it as UTF-8");
    }
    for (const auto step :
         {&Parser::ParseHierarchy, &Parser::ParseMotionHead, &Parser::ParseRows}) {
      if (Status status = (this->*step)(); !status)
        return std::unexpected(std::move(status.error()));
    }
    if (replaced_names_ > 0) {
      NoteAt(replaced_name_line_, "the name is not UTF-8; _ replaces its special characters" +
                                      AndMore(replaced_names_ - 1, "name"));
    }
    if (wrapped_rows_ > 0) {
      NoteAt(wrapped_row_line_,
             "the frame continues on the next line" + AndMore(wrapped_rows_ - 1, "frame"));
    }
    return std::move(file_);
  }

 private:
  std::unexpected<Error> FailAt(int line, ErrorCode code, const char* sentence,
                                std::int64_t index = -1) const {
    return Fail(code, sentence, name_ + ':' + std::to_string(line), index);
  }
  std::unexpected<Error> Malformed(const char* sentence) const {
    return FailAt(token_line_, ErrorCode::kMalformed, sentence);
  }

  void NoteAt(int line, const std::string& text) {
    file_.notes.push_back("line " + std::to_string(line) + ": " + text);
  }
  // Returns ", as in 3 more frames", or an empty string if the count is zero.
  static std::string AndMore(int count, const char* noun) {
    if (count == 0) return "";
    return ", as in " + std::to_string(count) + " more " + noun + (count == 1 ? "" : "s");
  }

  // Skips one line end (LF, CRLF or CR) at `at_`.
  void SkipLineEnd() {
    if (text_[at_] == '\r' && at_ + 1 < text_.size() && text_[at_ + 1] == '\n') ++at_;
    ++at_;
    ++line_;
  }
  static bool IsLineEnd(char c) { return c == '\n' || c == '\r'; }

  // Skips spaces, and a comment that ends the line.
  void SkipSpaceInLine() {
    while (at_ < text_.size() && IsSpace(text_[at_])) ++at_;
    if (at_ >= text_.size() || (text_[at_] != '#' && !text_.substr(at_).starts_with("//"))) return;
    while (at_ < text_.size() && !IsLineEnd(text_[at_])) ++at_;
  }

  // Skips spaces, line ends and comments.
  void SkipSpace() {
    SkipSpaceInLine();
    while (at_ < text_.size() && IsLineEnd(text_[at_])) {
      SkipLineEnd();
      SkipSpaceInLine();
    }
  }

  // Returns the next word. A brace is a word. Returns an empty string at the end of the text.
  std::string_view Next() {
    SkipSpace();
    token_line_ = line_;
    const std::size_t begin = at_;
    while (at_ < text_.size() && !IsSpace(text_[at_]) && !IsLineEnd(text_[at_])) {
      const char c = text_[at_];
      if (c == '{' || c == '}') {
        if (at_ == begin) ++at_;
        break;
      }
      ++at_;
    }
    return text_.substr(begin, at_ - begin);
  }

  // Returns the rest of the line up to an opening brace, without surrounding space.
  std::string_view RestOfLine() {
    while (at_ < text_.size() && IsSpace(text_[at_])) ++at_;
    token_line_ = line_;
    const std::size_t begin = at_;
    while (at_ < text_.size() && !IsLineEnd(text_[at_]) && text_[at_] != '{') ++at_;
    std::string_view rest = text_.substr(begin, at_ - begin);
    while (!rest.empty() && IsSpace(rest.back())) rest.remove_suffix(1);
    return rest;
  }

  // Returns the next word without consuming it.
  std::string_view Peek() {
    const std::size_t at = at_;
    const int line = line_;
    const int token_line = token_line_;
    const std::string_view word = Next();
    at_ = at;
    line_ = line;
    token_line_ = token_line;
    return word;
  }

  // Parses a number with a decimal point, or with a decimal comma if no number has a point.
  NumberFault ReadNumber(std::string_view token, double& value) {
    if (!has_decimal_comma_) {
      const NumberFault fault = ParseNumber(token, value);
      if (fault != NumberFault::kNotANumber) return fault;
    }
    const std::size_t comma = token.find(',');
    const bool has_point = token.find('.') != std::string_view::npos;
    if (comma == std::string_view::npos) {
      const NumberFault fault = ParseNumber(token, value);
      return has_point && fault == NumberFault::kNone ? NumberFault::kMixedPoint : fault;
    }
    if (token.size() > kMaxNumberBytes) return NumberFault::kNotANumber;
    std::string with_point(token);
    with_point[comma] = '.';
    const NumberFault fault = ParseNumber(with_point, value);
    if (fault != NumberFault::kNone) return fault;
    if (!has_decimal_comma_) {
      if (HasDecimalPoint(text_.substr(0, at_))) return NumberFault::kMixedPoint;
      has_decimal_comma_ = true;
      NoteAt(line_, "commas in numbers are read as decimal points");
    }
    return NumberFault::kNone;
  }

  Status NumberError(int line, NumberFault fault, const char* sentence, std::int64_t index = -1) {
    switch (fault) {
      case NumberFault::kNone: return {};
      case NumberFault::kNotANumber: return FailAt(line, ErrorCode::kMalformed, sentence, index);
      case NumberFault::kMixedPoint:
        return FailAt(line, ErrorCode::kMalformed, kMixedPointText, index);
      case NumberFault::kTooLarge: break;
    }
    return FailAt(line, ErrorCode::kOutOfRange, kTooLargeText, index);
  }

  Status NextNumber(double& value, const char* sentence) {
    const NumberFault fault = ReadNumber(Next(), value);
    return NumberError(token_line_, fault, sentence);
  }

  Status ParseOffset(DVec3& offset) {
    for (int axis = 0; axis < 3; ++axis) {
      if (Status status = NextNumber(offset[axis], "expected three numbers after OFFSET");
          !status) {
        return status;
      }
    }
    return {};
  }

  Status ParseChannels(BvhJoint& joint) {
    double count = 0.0;
    if (Status status = NextNumber(count, "expected the number of channels after CHANNELS");
        !status) {
      return status;
    }
    if (!(count >= 0.0 && count <= kMaxChannels) || count != std::floor(count)) {
      return FailAt(token_line_, ErrorCode::kOutOfRange, "expected 0 to 9 channels");
    }
    STRIDEWIRE_CHECK(joint.channels.empty());
    joint.first_channel = file_.channel_count;
    for (int i = 0; i < static_cast<int>(count); ++i) {
      const std::string_view word = Next();
      BvhChannel channel;
      if (word.empty() || (channel.axis = Lower(word[0]) - 'x') < 0 || channel.axis > 2) {
        return Malformed("expected a channel name such as Xposition or Zrotation");
      }
      if (EqualsWord(word.substr(1), "rotation")) {
        channel.kind = BvhChannelKind::kRotation;
      } else if (EqualsWord(word.substr(1), "scale")) {
        channel.kind = BvhChannelKind::kScale;
      } else if (!EqualsWord(word.substr(1), "position")) {
        return Malformed("expected a channel name such as Xposition or Zrotation");
      }
      for (const BvhChannel& other : joint.channels) {
        if (other.axis == channel.axis && other.kind == channel.kind) {
          return Malformed("duplicate channel");
        }
      }
      joint.channels.push_back(channel);
    }
    file_.channel_count += static_cast<int>(count);
    return {};
  }

  Status OpenJoint(int parent) {
    const int line = line_;
    std::string name(RestOfLine());
    if (name.empty()) return FailAt(line, ErrorCode::kMalformed, "expected a joint name");
    if (name.size() > kMaxBvhNameBytes) {
      return FailAt(line, ErrorCode::kLimitExceeded, "the joint name is longer than 256 bytes");
    }
    for (const char c : name) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
        return FailAt(line, ErrorCode::kMalformed, "the joint name contains a control character");
      }
    }
    if (!IsUtf8(name)) {
      for (char& c : name) {
        if (static_cast<unsigned char>(c) >= 0x80) c = '_';
      }
      if (replaced_names_++ == 0) replaced_name_line_ = line;
    }
    if (static_cast<int>(file_.joints.size()) >= kMaxJoints) {
      return FailAt(line, ErrorCode::kLimitExceeded, "the skeleton has more joints than the limit",
                    kMaxJoints);
    }
    if (static_cast<int>(stack_.size()) >= kMaxBvhDepth) {
      return FailAt(line, ErrorCode::kLimitExceeded, "joints are nested deeper than the limit",
                    kMaxBvhDepth);
    }
    if (!names_.insert(name).second) {
      for (int number = 2;; ++number) {
        std::string numbered = name + '_' + std::to_string(number);
        if (!names_.insert(numbered).second) continue;
        file_.notes.push_back("duplicate joint " + name + " is renamed to " + numbered);
        name = std::move(numbered);
        break;
      }
    }
    if (Next() != "{") return Malformed("expected { after a joint name");
    STRIDEWIRE_CHECK(parent < static_cast<int>(file_.joints.size()));
    BvhJoint joint;
    joint.name = std::move(name);
    joint.parent = parent;
    joint.line = line;
    stack_.push_back({static_cast<int>(file_.joints.size()), false, false});
    file_.joints.push_back(std::move(joint));
    return {};
  }

  Status ParseEndSite(int joint) {
    RestOfLine();  // Usually "Site".
    if (Next() != "{") return Malformed("expected { after End Site");
    if (!EqualsWord(Next(), "offset")) return Malformed("expected OFFSET in an End Site");
    BvhEndSite site;
    site.joint = joint;
    site.line = token_line_;
    if (Status status = ParseOffset(site.offset); !status) return status;
    if (Next() != "}") return Malformed("expected } after an End Site");
    if (file_.end_sites.size() >= static_cast<std::size_t>(kMaxJoints)) {
      return FailAt(token_line_, ErrorCode::kLimitExceeded,
                    "the skeleton has more End Sites than the limit", kMaxJoints);
    }
    file_.end_sites.push_back(site);
    return {};
  }

  Status ParseHierarchy() {
    if (!EqualsWord(Next(), "hierarchy")) {
      return Malformed("expected HIERARCHY at the beginning; this is not a BVH file");
    }
    if (!EqualsWord(Next(), "root")) return Malformed("expected ROOT after HIERARCHY");
    if (Status status = ParseRoot(); !status) return status;
    while (EqualsWord(Peek(), "root")) {
      Next();
      if (Status status = ParseRoot(); !status) return status;
    }
    if (file_.channel_count == 0) {
      Next();
      return Malformed("expected CHANNELS for at least one joint");
    }
    return {};
  }

  // Parses a root and all joints below it. Uses its own stack instead of recursion, so that no file
  // can overflow the call stack.
  Status ParseRoot() {
    if (Status status = OpenJoint(-1); !status) return status;
    while (!stack_.empty()) {
      Open& open = stack_.back();
      BvhJoint& joint = file_.joints[static_cast<std::size_t>(open.joint)];
      const std::string_view word = Next();
      Status status;
      if (word.empty()) {
        return Malformed("the file ends inside HIERARCHY");
      } else if (word == "}") {
        if (!open.has_offset) return Malformed("the joint has no OFFSET");
        stack_.pop_back();
      } else if (EqualsWord(word, "offset")) {
        if (open.has_offset) return Malformed("the joint has two OFFSETs");
        open.has_offset = true;
        joint.line = token_line_;
        status = ParseOffset(joint.offset);
      } else if (EqualsWord(word, "channels")) {
        if (open.has_channels) return Malformed("the joint has two CHANNELS");
        open.has_channels = true;
        status = ParseChannels(joint);
      } else if (EqualsWord(word, "joint")) {
        status = OpenJoint(open.joint);
      } else if (EqualsWord(word, "end")) {
        status = ParseEndSite(open.joint);
      } else {
        return Malformed("expected OFFSET, CHANNELS, JOINT, End Site or }");
      }
      if (!status) return status;
    }
    return {};
  }

  // Skips a label such as "Frames:" or "Frame Time:". Accepts "Frames: 10", "Frames:10",
  // "Frames : 10" and "Frames 10".
  bool SkipLabel(std::string_view lower_first, std::string_view lower_second) {
    const auto skip = [&](std::string_view lower_word) {
      SkipSpace();
      token_line_ = line_;
      if (!StartsWithWord(text_.substr(at_), lower_word)) return false;
      at_ += lower_word.size();
      return true;
    };
    if (!skip(lower_first)) return false;
    if (!lower_second.empty() && !skip(lower_second)) return false;
    while (at_ < text_.size() && IsSpace(text_[at_])) ++at_;
    if (at_ < text_.size() && text_[at_] == ':') ++at_;
    return true;
  }

  Status ParseFrameCount() {
    const std::string_view count = Next();
    frames_line_ = token_line_;
    double value = 0.0;
    const char* const expected = "Frames: expected an integer of at least 0";
    // A count above kMaxBvhNumber is valid, since the file may contain fewer frames.
    const NumberFault fault = ParseNumber(count, value);
    if ((fault != NumberFault::kNone && fault != NumberFault::kTooLarge) || !(value >= 0.0) ||
        value != std::floor(value)) {
      return Malformed(expected);
    }
    if (value >= 9e18) {
      declared_frames_ = INT64_MAX;  // No file can have that many rows.
    } else {
      declared_frames_ = static_cast<std::int64_t>(value);
    }
    if (!std::ranges::all_of(count, IsDigit)) {
      NoteAt(frames_line_, "the number of frames is written as " +
                               std::string(count.substr(0, kMaxNumberBytes)) +
                               ", not as an integer");
    }
    return {};
  }

  Status ParseMotionHead() {
    if (!EqualsWord(Next(), "motion")) return Malformed("expected MOTION after HIERARCHY");
    if (!SkipLabel("frames", "")) return Malformed("expected Frames: after MOTION");
    if (Status status = ParseFrameCount(); !status) return status;
    if (double number = 0.0; ParseNumber(Peek(), number) == NumberFault::kNone) {
      SkipSpace();
      file_.has_frame_time = false;
      file_.frame_time_line = line_;
      return {};
    }
    if (!SkipLabel("frame", "time")) return Malformed("expected Frame Time: after Frames:");
    SkipSpace();
    const std::size_t begin = at_;
    if (Status status = NextNumber(file_.frame_time_s, "Frame Time: expected a number of seconds");
        !status) {
      return status;
    }
    file_.frame_time_line = token_line_;
    std::string written(text_.substr(begin, at_ - begin));
    std::ranges::replace(written, ',', '.');
    file_.frame_time_digit_s = LastDigit(written);
    SkipSpaceInLine();
    if (!RestOfLine().empty()) return Malformed("Frame Time: unexpected text after the number");
    return {};
  }

  Status ParseRows() {
    const std::size_t channels = static_cast<std::size_t>(file_.channel_count);
    const std::int64_t joints = static_cast<std::int64_t>(file_.joints.size());
    // A number takes at least two characters with its separator. This limits the number of rows.
    const std::size_t most_rows = (text_.size() - at_) / (2 * channels) + 1;
    file_.values.reserve(channels *
                         std::min(most_rows, static_cast<std::size_t>(declared_frames_)));
    std::int64_t frames = 0;
    for (;;) {
      SkipSpace();
      if (at_ >= text_.size()) break;
      if (frames == declared_frames_ && declared_frames_ > 0) {
        NoteAt(line_, "ignored the frames beyond the number declared by Frames:");
        break;
      }
      if ((frames + 1) * joints > kMaxBvhRotations) {
        return FailAt(line_, ErrorCode::kLimitExceeded, "the motion has more frames than the limit",
                      frames);
      }
      const int line = line_;
      Expected<bool> complete = ParseRow(channels);
      if (!complete) return std::unexpected(std::move(complete.error()));
      if (!*complete) {
        const std::size_t kept = static_cast<std::size_t>(frames) * channels;
        if (frames == 0) {
          return FailAt(line, ErrorCode::kMalformed, kFewerNumbersText,
                        static_cast<std::int64_t>(file_.values.size() - kept));
        }
        file_.values.resize(kept);
        NoteAt(line, "the last frame is incomplete and is left out");
        break;
      }
      ++frames;
    }
    if (frames == 0) {
      return FailAt(line_, ErrorCode::kMalformed, "expected at least one frame after Frame Time:");
    }
    if (frames < declared_frames_ || declared_frames_ == 0) {
      NoteAt(frames_line_, "Frames: declares " + std::to_string(declared_frames_) +
                               " frames, but the file contains " + std::to_string(frames));
    }
    STRIDEWIRE_CHECK(file_.values.size() == static_cast<std::size_t>(frames) * channels);
    file_.frame_count = static_cast<int>(frames);
    return {};
  }

  // Parses a frame, which may continue on further lines but must end at the end of a line. Returns
  // false if the file ends before the frame is complete.
  Expected<bool> ParseRow(std::size_t channels) {
    const int first_line = line_;
    std::size_t in_first_line = 0;
    for (std::size_t i = 0;; ++i) {
      SkipSpaceInLine();
      if (at_ >= text_.size() || IsLineEnd(text_[at_])) {
        if (line_ == first_line) in_first_line = i;
        if (i == channels) break;
        SkipSpace();
        if (at_ >= text_.size()) return false;
      }
      if (i == channels) {
        if (line_ == first_line) {
          return FailAt(line_, ErrorCode::kMalformed, "the frame has more numbers than channels");
        }
        return FailAt(first_line, ErrorCode::kMalformed, kFewerNumbersText,
                      static_cast<std::int64_t>(in_first_line));
      }
      const std::size_t begin = at_;
      while (at_ < text_.size() && !IsSpace(text_[at_]) && !IsLineEnd(text_[at_])) ++at_;
      double value = 0.0;
      const NumberFault fault = ReadNumber(text_.substr(begin, at_ - begin), value);
      if (fault != NumberFault::kNone) {
        return std::unexpected(
            NumberError(line_, fault, "expected a number", static_cast<std::int64_t>(i)).error());
      }
      file_.values.push_back(static_cast<float>(value));
    }
    if (line_ != first_line && wrapped_rows_++ == 0) wrapped_row_line_ = first_line;
    return true;
  }

  struct Open {
    int joint;
    bool has_offset;
    bool has_channels;
  };

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0;
  int line_ = 1;
  int token_line_ = 1;
  std::int64_t declared_frames_ = 0;
  int frames_line_ = 0;
  bool has_decimal_comma_ = false;
  int replaced_names_ = 0;
  int replaced_name_line_ = 0;
  int wrapped_rows_ = 0;
  int wrapped_row_line_ = 0;
  std::vector<Open> stack_;
  std::unordered_set<std::string> names_;
  BvhFile file_;
};

}  // namespace

Expected<BvhFile> ParseBvhFile(std::string_view text, std::string_view name) {
  return Parser(text, name).Run();
}

}  // namespace stridewire
