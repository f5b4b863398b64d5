// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport_file.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <system_error>
#include <vector>

#include "diagnostics/error.h"
#include "files/atomic_file.h"

namespace interglow::radiosity {
namespace {

static_assert(std::endian::native == std::endian::little, "the arrays of an .npz are written as they lie in memory");

void write_matrix_market(const Transport& transport, const std::string& comment, const Progress& progress,
                         std::ostream& out) {
  std::int64_t count = 0;
  std::vector<int> columns;
  std::vector<double> factors;
  for (Eigen::Index i = 0; i < transport.size(); ++i) {
    transport.row(i, columns, factors);
    count += static_cast<std::int64_t>(columns.size());
  }
  fmt::memory_buffer text;
  const auto to = std::back_inserter(text);
  fmt::format_to(to, "%%MatrixMarket matrix coordinate real general\n% ");
  for (const char c : comment) fmt::format_to(to, "{}", c == '\n' ? std::string("\n% ") : std::string(1, c));
  fmt::format_to(to, "\n{0} {0} {1}\n", transport.size(), count);
  for (Eigen::Index i = 0; i < transport.size(); ++i) {
    transport.row(i, columns, factors);
    for (std::size_t k = 0; k < columns.size(); ++k)
      fmt::format_to(to, "{} {} {}\n", i + 1, columns[k] + 1, factors[k]);
    out.write(text.data(), static_cast<std::streamsize>(text.size()));
    text.clear();
    if (i % 256 == 0) progress.update("writing", static_cast<double>(i) / static_cast<double>(transport.size()));
  }
}

/// One array in NumPy's .npy format, version 1.0.
template <class T>
std::string npy(const char* type, const std::vector<T>& values, bool scalar = false) {
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type,
                                   scalar ? std::string("()") : fmt::format("({},)", values.size()));
  constexpr std::size_t kMagic = 10;
  header.append(63 - (kMagic + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xFF);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  return bytes;
}

std::uint32_t crc32(const std::string& bytes) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> entries{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t value = n;
      for (int bit = 0; bit < 8; ++bit) value = (value & 1U) != 0 ? 0xEDB88320U ^ (value >> 1) : value >> 1;
      entries[n] = value;
    }
    return entries;
  }();
  std::uint32_t crc = ~0U;
  for (const char c : bytes) crc = table[(crc ^ static_cast<unsigned char>(c)) & 0xFFU] ^ (crc >> 8);
  return ~crc;
}

/// A zip archive of stored (uncompressed) members.
class ZipWriter {
 public:
  explicit ZipWriter(std::ostream& out) : out_(out) {}

  void add(const std::string& name, const std::string& bytes) {
    if (offset_ + bytes.size() + name.size() + 64 > std::numeric_limits<std::uint32_t>::max()) {
      throw InvalidParams("form factors: the .npz would pass 4 GiB. Write .mtx instead.");
    }
    std::string common;
    put<std::uint16_t>(common, 20);  // version needed
    put<std::uint16_t>(common, 0);   // flags
    put<std::uint16_t>(common, 0);   // stored
    put<std::uint16_t>(common, 0);   // time
    put<std::uint16_t>(common, 33);  // 1980-01-01: the same bytes each time
    put<std::uint32_t>(common, crc32(bytes));
    put<std::uint32_t>(common, static_cast<std::uint32_t>(bytes.size()));
    put<std::uint32_t>(common, static_cast<std::uint32_t>(bytes.size()));
    put<std::uint16_t>(common, static_cast<std::uint16_t>(name.size()));
    put<std::uint16_t>(common, 0);  // no extra field
    directory_ += "PK\x01\x02";
    put<std::uint16_t>(directory_, 20);
    directory_ += common;
    directory_.append(10, '\0');  // comment length, disk, attributes
    put<std::uint32_t>(directory_, static_cast<std::uint32_t>(offset_));
    directory_ += name;
    write("PK\x03\x04" + common + name);
    write(bytes);
    ++members_;
  }

  void finish() {
    const std::uint64_t start = offset_;
    write(directory_);
    std::string end = "PK\x05\x06";
    put<std::uint32_t>(end, 0);
    put<std::uint16_t>(end, members_);
    put<std::uint16_t>(end, members_);
    put<std::uint32_t>(end, static_cast<std::uint32_t>(directory_.size()));
    put<std::uint32_t>(end, static_cast<std::uint32_t>(start));
    put<std::uint16_t>(end, 0);
    write(end);
  }

 private:
  template <class T>
  static void put(std::string& bytes, T value) {
    for (std::size_t k = 0; k < sizeof(T); ++k) bytes += static_cast<char>((value >> (8 * k)) & 0xFF);
  }
  void write(const std::string& bytes) {
    out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    offset_ += bytes.size();
  }

  std::ostream& out_;
  std::uint64_t offset_ = 0;
  std::string directory_;
  std::uint16_t members_ = 0;
};

void write_npz(const Transport& transport, const Progress& progress, std::ostream& out) {
  std::vector<double> data;
  std::vector<std::int32_t> indices;
  std::vector<std::int64_t> row_start = {0};
  std::vector<int> columns;
  std::vector<double> factors;
  for (Eigen::Index i = 0; i < transport.size(); ++i) {
    transport.row(i, columns, factors);
    data.insert(data.end(), factors.begin(), factors.end());
    indices.insert(indices.end(), columns.begin(), columns.end());
    row_start.push_back(static_cast<std::int64_t>(data.size()));
    if (i % 256 == 0) progress.update("writing", static_cast<double>(i) / static_cast<double>(transport.size()));
  }
  const Eigen::VectorXd& area = transport.area_mm2();
  const std::int64_t n = transport.size();
  ZipWriter zip(out);
  zip.add("indices.npy", npy("<i4", indices));
  zip.add("indptr.npy", npy("<i8", row_start));
  zip.add("format.npy", npy("|S3", std::vector<char>{'c', 's', 'r'}, true));
  zip.add("shape.npy", npy("<i8", std::vector<std::int64_t>{n, n}));
  zip.add("data.npy", npy("<f8", data));
  zip.add("area_mm2.npy", npy("<f8", std::vector<double>(area.data(), area.data() + area.size())));
  zip.finish();
}

}  // namespace

void check_form_factor_file(const std::filesystem::path& path) {
  if (path.extension() != ".mtx" && path.extension() != ".npz")
    throw InvalidParams(
        fmt::format("{}: form factors are written as .mtx (Matrix Market) or .npz (NumPy).", path.string()));
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw InvalidParams(fmt::format("{}: is a folder; expected the name of a file to write.", path.string()));
}

void write_form_factors(const Transport& transport, const std::filesystem::path& path, const std::string& comment,
                        const Progress& progress) {
  check_form_factor_file(path);
  const bool market = path.extension() == ".mtx";
  files::write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    if (market) {
      write_matrix_market(transport, comment, progress, out);
    } else {
      write_npz(transport, progress, out);
    }
    out.close();
    if (!out) throw InvalidInput(fmt::format("{}: could not be written (is the disk full?).", path.string()));
  });
}

}  // namespace interglow::radiosity
