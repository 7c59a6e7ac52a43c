#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "offline/complete/complete_library.h"
#include "offline/extract/assemble.h"
#include "offline/extract/extract.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Reports on a build. As text, it prints each part at once. As JSON, it collects all parts and
// prints one object at the end, even if the build fails. The JSON contains everything that the text
// contains.
class BuildReport {
 public:
  explicit BuildReport(bool as_json);

  // Reports on a file. If the file is unusable, prints the reason on stderr.
  void AddFile(const Extraction& extraction, const AssembleOptions& options);

  // Reports which movements the captures lack, and which were generated instead.
  void AddCompletion(const Completion& completion);

  // Reports on the library written to `path`: its groups, notes and summary and, unless
  // `skips_self_check`, its self-check.
  void AddLibrary(const std::string& path, const std::shared_ptr<const MotionLibrary>& library,
                  const LibraryBuilder& builder, bool skips_self_check);

  // Ends the report. Fail prints the sentence on stderr as well. Both return the exit code.
  int Fail(const std::string& sentence, int exit_code);
  int Succeed();

 private:
  bool as_json_;
  nlohmann::ordered_json json_;
};

}  // namespace stridewire
