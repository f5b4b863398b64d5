// SPDX-License-Identifier: GPL-3.0-or-later
/// Hashes that say which input made an output.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace interglow::files {

/// SHA-256 of a file's bytes, 64 hexadecimal digits. @throws InvalidInput if it cannot be read.
std::string sha256_of_file(const std::filesystem::path& path);

/// SHA-256 of bytes in memory.
std::string sha256(std::string_view bytes);

}  // namespace interglow::files
