#pragma once

namespace stridewire::server {

/// Runs stridewired with the arguments of main(). Returns the exit code (docs/SERVER.md).
[[nodiscard]] int RunProgram(int argc, char** argv);

}  // namespace stridewire::server
