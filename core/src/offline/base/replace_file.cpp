#include "offline/base/replace_file.h"

#include <unistd.h>

#include <fstream>
#include <string>
#include <system_error>

namespace stridewire {

Status ReplaceFile(const std::filesystem::path& path,
                   const std::function<Status(std::ostream&)>& write) {
  const std::filesystem::path partial = path.string() + ".part" + std::to_string(::getpid());
  std::error_code failed;
  Status status;
  {
    std::ofstream out(partial, std::ios::binary | std::ios::trunc);
    if (!out) return Fail(ErrorCode::kIo, "cannot create the file", path.string());
    status = write(out);
    out.close();
    if (status && !out) status = Fail(ErrorCode::kIo, "cannot write the file");
  }
  if (status) {
    std::filesystem::rename(partial, path, failed);
    if (!failed) return {};
    status = Fail(ErrorCode::kIo, "cannot rename the temporary file to this path");
  }
  std::filesystem::remove(partial, failed);
  status.error().where = path.string();
  return status;
}

}  // namespace stridewire
