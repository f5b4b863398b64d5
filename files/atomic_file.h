// SPDX-License-Identifier: GPL-3.0-or-later
/// Output files that are either whole or not there.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

namespace interglow::files {

/// Lets `write` fill a temporary file beside `path`, then renames it to `path`; on any exception the temporary
/// file is removed and `path` keeps its old content. The temporary name keeps the extension of `path`,
/// because image writers choose the format by it. Creates missing parent folders.
/// @throws InvalidInput if the file cannot be written, naming path and reason.
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

/// The same for text (or any bytes) in memory.
void write_text_atomically(const std::filesystem::path& path, std::string_view text);

/// Removes the temporary files of all writers at work and keeps them from renaming or starting any: for a process that
/// is about to exit without waiting for them. Whoever writes afterwards blocks for ever.
void abandon_unfinished();

}  // namespace interglow::files
