# Placeholder filled by the install rules: `cmake --install` and find_package(stridewire).
