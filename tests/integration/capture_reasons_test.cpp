// Every capture yields movements, or a reason why it yields none.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "capture_files.h"
#include "offline/extract/extract.h"
#include "offline/inspect/empty_file.h"

namespace stridewire {
namespace {

std::vector<std::filesystem::path> AllCaptures() {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator it(MocapDir(), error), end;
       !error && it != end; it.increment(error)) {
    if (it->path().extension() == ".bvh") files.push_back(it->path());
  }
  std::ranges::sort(files);
  return files;
}

TEST(CaptureReasons, EveryCaptureGivesMovementsOrAReason) {
  const std::vector<std::filesystem::path> files = AllCaptures();
  STRIDEWIRE_SKIP_WITHOUT(files);
  for (const std::filesystem::path& file : files) {
    SCOPED_TRACE(file.string());
    const auto capture = ReadBvh(file);
    if (!capture) {
      EXPECT_FALSE(Describe(capture.error()).empty());
      continue;
    }
    const Extraction extraction = Extract(*capture);
    const int movements = extraction.steps_left + extraction.steps_right + extraction.jumps;
    EXPECT_EQ(ReasonForNoMovements(extraction, true, true).empty(), movements > 0);
    if (extraction.jumps == 0) {
      EXPECT_FALSE(ReasonForNoMovements(extraction, false, true).empty());
    }
  }
}

}  // namespace
}  // namespace stridewire
