// The two file types of a COLMAP model, read sequentially. Every error names the path and the byte or line.
#pragma once
#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {

// A little-endian file. Counts are refused if the rest of the file cannot hold them.
class ColmapBytes {
 public:
  explicit ColmapBytes(const std::filesystem::path& path) : path_(path.string()), in_(path, std::ios::binary) {
    std::error_code error;
    size_ = std::filesystem::file_size(path, error);
    if (error || !in_) fail(Status::file, "{}: cannot be opened", path_);
  }
  const std::string& path() const { return path_; }
  std::uintmax_t left() const { return size_ - at_; }

  template <class T>
  T read(const char* what) {
    T out;
    need(sizeof out, what);
    in_.read(reinterpret_cast<char*>(&out), sizeof out);
    if (!in_) fail(Status::file, "{}: cannot be read at byte {}", path_, at_);
    at_ += sizeof out;
    return out;
  }
  // Number of records that follow, of at least `bytes` each.
  std::uint64_t count(const char* what, std::uint64_t bytes) {
    const auto n = read<std::uint64_t>(what);
    if (n > left() / bytes)
      fail(Status::format, "{}: byte {}: {} {} cannot be in the {} bytes that follow", path_, at_ - 8, n, what, left());
    return n;
  }
  void skip(std::uint64_t bytes) {
    need(bytes, "data");
    at_ += bytes;
    if (bytes < 4096)  // stay within the buffer; a seek would discard it
      in_.ignore(static_cast<std::streamsize>(bytes));
    else
      in_.seekg(static_cast<std::streamoff>(at_));
  }
  std::string text(const char* what) {
    std::string out;
    for (const std::uintmax_t begin = at_; out.size() < 4096;) {
      const char c = read<char>(what);
      if (c == '\0') {
        if (out.empty()) fail(Status::format, "{}: byte {}: {} is empty", path_, begin, what);
        return out;
      }
      out += c;
    }
    fail(Status::format, "{}: byte {}: {} has no end within 4096 bytes", path_, at_, what);
  }
  void end() const {
    if (left() != 0) fail(Status::format, "{}: byte {}: {} bytes follow the last record", path_, at_, left());
  }

 private:
  void need(std::uint64_t bytes, const char* what) const {
    if (bytes > left()) fail(Status::format, "{}: ends at byte {} where {} begins at byte {}", path_, size_, what, at_);
  }

  std::string path_;
  std::ifstream in_;
  std::uintmax_t size_ = 0, at_ = 0;
};

// The lines of a text file, without comments and carriage returns.
class ColmapLines {
 public:
  explicit ColmapLines(const std::filesystem::path& path) : path_(path.string()), in_(path) {
    if (!in_) fail(Status::file, "{}: cannot be opened", path_);
  }
  bool any_line() {
    if (!std::getline(in_, line_)) return false;
    if (++number_ == 1 && line_.starts_with("\xef\xbb\xbf")) line_.erase(0, 3);  // a byte order mark
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ' || line_.back() == '\t')) line_.pop_back();
    rest_ = line_;
    return true;
  }
  bool record_line() {
    while (any_line()) {
      skip_blanks();
      if (!rest_.empty() && rest_[0] != '#') return true;
    }
    return false;
  }
  std::string where() const { return fmt::format("{}: line {}", path_, number_); }
  std::string_view word() {
    skip_blanks();
    const std::string_view out = rest_.substr(0, rest_.find_first_of(" \t"));
    rest_.remove_prefix(out.size());
    return out;
  }
  std::string_view rest() {
    skip_blanks();
    return rest_;
  }
  template <class T>
  T value(const char* what) {
    const std::string_view text = word();
    T out{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    if (text.empty() || error != std::errc() || end != text.data() + text.size())
      fail(Status::format, "{}: {} is \"{}\", a number is expected", where(), what, printable(text));
    return out;
  }

 private:
  void skip_blanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  std::string path_, line_;
  std::ifstream in_;
  std::string_view rest_;
  long number_ = 0;
};

}  // namespace vsplat
