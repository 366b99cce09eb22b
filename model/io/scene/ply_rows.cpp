#include "model/io/scene/ply_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <limits>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 20;  // read at a time; also the longest line of text

float to_float(double v) {
  constexpr double largest = std::numeric_limits<float>::max();
  if (v > largest) return std::numeric_limits<float>::infinity();
  if (v < -largest) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(v);
}

// Non-finite numbers as older Windows programs write them: "1.#QNAN", "-1.#IND", "1.#INF"; zeros may follow.
bool is_windows_number(std::string_view word, double& value) {
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.remove_prefix(1);
  if (!word.starts_with("1.#")) return false;
  word.remove_prefix(3);
  word = word.substr(0, word.find_last_not_of('0') + 1);
  const bool infinite = word == "INF";
  if (!infinite && word != "QNAN" && word != "SNAN" && word != "IND" && word != "NAN") return false;
  value = infinite ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
  if (negative) value = -value;
  return true;
}

[[noreturn]] void promises_too_much(const PlyFile& file, const PlyElement& e, const std::string& each, std::uint64_t at,
                                    std::uint64_t whole) {
  fail(Status::format,
       "{}: element {}: the header promises {} of {} each from byte {} on, the file has {} bytes, which is {} of them: "
       "it is cut off or damaged",
       file.path(), e.name, e.count, each, at, file.size(), whole);
}

void warn_of_rest(const PlyFile& file, std::uint64_t at) {
  warn("{}: {} bytes after the last element are ignored (from byte {} on)", file.path(), file.size() - at, at);
}

// Rows of `stride` bytes in either byte order.
class BinaryRows : public PlyRows {
 public:
  BinaryRows(PlyFile& file, const PlyHeader& header, const PlyElement& element, std::vector<const PlyProperty*> wanted,
             bool tells_rest)
      : file_(file),
        element_(element),
        wanted_(std::move(wanted)),
        swap_(header.format == PlyFormat::big_endian),
        tells_rest_(tells_rest) {
    for (const PlyProperty* p : wanted_) all_floats_ &= p->type == PlyType::f32;
    block_at_ = find(header);
    file_.seek(block_at_);
    most_ = std::max<std::size_t>(1, kBlock / element.stride);
  }

  void next(float* values) override {
    if (++row_ >= rows_) read_block();
    data_ = &block_[row_ * element_.stride];
    const std::size_t n = wanted_.size();
    if (all_floats_) {
      for (std::size_t i = 0; i < n; ++i) std::memcpy(values + i, data_ + wanted_[i]->offset, sizeof(float));
    } else {
      for (std::size_t i = 0; i < n; ++i) values[i] = to_float(value(i));
    }
  }
  double value(std::size_t i) const override { return ply_value(wanted_[i]->type, data_ + wanted_[i]->offset); }
  std::uint64_t byte_of(std::size_t i) const override {
    return block_at_ + row_ * element_.stride + wanted_[i]->offset;
  }

 private:
  // Offset of the element; checks the elements around it.
  std::uint64_t find(const PlyHeader& header) {
    std::uint64_t at = header.size, begin = 0;
    for (const PlyElement& e : header.elements) {
      const bool wanted = &e == &element_;
      if (wanted) begin = at;
      if (e.has_list()) {
        if (begin) return begin;  // later elements are not read
        at = end_of_lists(e, at);
        continue;
      }
      if (e.stride != 0 && e.count > (file_.size() - at) / e.stride)
        promises_too_much(file_, e, fmt::format("{} bytes", e.stride), at, (file_.size() - at) / e.stride);
      at += e.count * e.stride;
    }
    if (at < file_.size() && tells_rest_) warn_of_rest(file_, at);
    return begin;
  }

  // End of an element with lists, found from each list's length. Its rows begin at byte `at`.
  std::uint64_t end_of_lists(const PlyElement& e, std::uint64_t at) {
    std::vector<unsigned char> window;
    std::uint64_t window_at = at;
    const auto cut_off = [&](std::uint64_t row) {
      fail(Status::format, "{}: element {}: ends within row {} of {} (byte {}): it is cut off or damaged", file_.path(),
           e.name, row, e.count, at);
    };
    for (std::uint64_t row = 0; row < e.count; ++row)
      for (const PlyColumn& column : e.columns) {
        const std::size_t bytes = size_of(column.is_list ? column.length : column.type);
        if (at > file_.size() || bytes > file_.size() - at) cut_off(row);
        if (!column.is_list) {
          at += bytes;
          continue;
        }
        if (at < window_at || at - window_at + bytes > window.size()) {
          window_at = at;
          window.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, file_.size() - at)));
          file_.seek(at);
          if (file_.read(window.data(), window.size()) != window.size()) cut_off(row);
        }
        std::array<unsigned char, 8> length{};
        std::copy_n(&window[static_cast<std::size_t>(at - window_at)], bytes, length.begin());
        if (swap_) std::reverse(length.begin(), length.begin() + static_cast<std::ptrdiff_t>(bytes));
        const double count = ply_value(column.length, length.data());
        at += bytes;
        if (!(count >= 0) || count * static_cast<double>(size_of(column.type)) > static_cast<double>(file_.size() - at))
          cut_off(row);
        at += static_cast<std::uint64_t>(count) * size_of(column.type);
      }
    return at;
  }

  void read_block() {
    block_at_ += rows_ * element_.stride;
    const std::uint64_t left = element_.count - taken_;
    rows_ = static_cast<std::size_t>(std::min<std::uint64_t>(left, most_));
    block_.resize(rows_ * element_.stride);
    if (file_.read(block_.data(), block_.size()) != block_.size())
      fail(Status::format, "{}: element {}: ends within the {} rows from {} on (byte {})", file_.path(), element_.name,
           rows_, taken_, block_at_);
    taken_ += rows_;
    row_ = 0;
    if (!swap_) return;
    for (std::size_t r = 0; r < rows_; ++r)
      for (const PlyProperty& p : element_.properties) {
        unsigned char* begin = &block_[r * element_.stride + p.offset];
        std::reverse(begin, begin + size_of(p.type));
      }
  }

  PlyFile& file_;
  const PlyElement& element_;
  std::vector<const PlyProperty*> wanted_;
  bool swap_, tells_rest_, all_floats_ = true;
  std::vector<unsigned char> block_;
  const unsigned char* data_ = nullptr;  // of the current row
  std::size_t most_ = 0, rows_ = 0, row_ = 0;
  std::uint64_t taken_ = 0, block_at_ = 0;
};

// One row per line.
class TextRows : public PlyRows {
 public:
  TextRows(PlyFile& file, const PlyHeader& header, const PlyElement& element, std::vector<const PlyProperty*> wanted)
      : file_(file), element_(element), values_(element.properties.size()), begins_(element.properties.size()) {
    for (const PlyProperty* p : wanted) columns_.push_back(static_cast<std::size_t>(p - element.properties.data()));
    at_ = header.size;
    file_.seek(at_);
    block_ = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, file_.size()));
    for (const PlyElement& e : header.elements) {
      // A value takes at least a digit and a blank.
      const std::uint64_t row = std::max<std::uint64_t>(1, 2 * e.properties.size());
      if (e.count > (file_.size() - at_ + 1) / row)
        promises_too_much(file_, e, fmt::format("at least {} bytes", row), at_, (file_.size() - at_ + 1) / row);
      if (&e == &element_) break;
      for (std::uint64_t i = 0; i < e.count; ++i) next_line(e, i);
    }
    is_last_ = &element_ == &header.elements.back();
  }

  void next(float* values) override {
    std::string_view line = next_line(element_, row_);
    for (std::size_t i = 0; i < values_.size(); ++i) values_[i] = number(line, i);
    take_blanks(line);
    if (!line.empty())
      fail(Status::format, "{}: Gaussian {} (byte {}): more than the {} values of element {}", file_.path(), row_,
           line_end_ - line.size(), values_.size(), element_.name);
    for (std::size_t i = 0; i < columns_.size(); ++i) values[i] = to_float(values_[columns_[i]]);
    if (++row_ == element_.count && is_last_) check_end();
  }
  double value(std::size_t i) const override { return values_[columns_[i]]; }
  std::uint64_t byte_of(std::size_t i) const override { return begins_[columns_[i]]; }

 private:
  static constexpr std::string_view kBlanks = " \t\r\v\f";

  static void take_blanks(std::string_view& line) {
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  }

  double number(std::string_view& line, std::size_t i) {
    take_blanks(line);
    begins_[i] = line_end_ - line.size();
    const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
    line.remove_prefix(word.size());
    const char* const first = word.data() + (word.size() > 1 && word[0] == '+');
    const char* const last = word.data() + word.size();
    double v = 0;
    if (is_windows_number(word, v)) return v;
    const auto [end, problem] = std::from_chars(first, last, v);
    if (end != last || problem == std::errc::invalid_argument)
      fail(Status::format, "{}: Gaussian {}, {} (byte {}): \"{}\", a number is expected", file_.path(), row_,
           printable(element_.properties[i].name), begins_[i], printable(word));
    if (problem == std::errc()) return v;
    // Outside a double's range: too small or too large.
    const bool tiny = word.find("e-") != word.npos || word.find("E-") != word.npos;
    const double size = tiny ? 0 : std::numeric_limits<double>::infinity();
    return word[0] == '-' ? -size : size;
  }

  // A line without its end; blank lines are skipped. Valid until the next call.
  std::string_view next_line(const PlyElement& e, std::uint64_t row) {
    for (;;) {
      std::size_t end = text_.find('\n', begin_);
      if (end == text_.npos) {
        text_.erase(0, begin_);
        begin_ = 0;
        const std::size_t kept = text_.size();
        if (kept > kBlock)
          fail(Status::format, "{}: element {}: row {} (byte {}) has no end within {} bytes", file_.path(), e.name, row,
               at_, kept);
        text_.resize(kept + block_);
        text_.resize(kept + file_.read(&text_[kept], block_));
        if (text_.size() > kept) continue;
        if (kept == 0)
          fail(Status::format, "{}: element {}: the header promises {} rows, the file ends after {} (byte {})",
               file_.path(), e.name, e.count, row, at_);
        end = kept;  // the last line, without a line end
      }
      const std::string_view line(&text_[begin_], end - begin_);
      const std::size_t whole = std::min(end + 1, text_.size()) - begin_;
      begin_ += whole;
      at_ += whole;
      line_end_ = at_ - whole + line.size();
      if (line.find_first_not_of(kBlanks) != line.npos || e.properties.empty()) return line;
    }
  }

  void check_end() {
    const std::uint64_t end = at_;
    for (std::string rest = text_.substr(begin_);;) {
      if (rest.find_first_not_of(" \t\r\v\f\n") != rest.npos) return warn_of_rest(file_, end);
      rest.resize(block_);
      rest.resize(file_.read(rest.data(), rest.size()));
      if (rest.empty()) return;
    }
  }

  PlyFile& file_;
  const PlyElement& element_;
  std::vector<std::size_t> columns_;  // of the wanted properties
  std::vector<double> values_;        // all values of a row
  std::vector<std::uint64_t> begins_;
  std::size_t block_ = 0;  // bytes read at a time
  std::string text_;       // buffer; begins at byte at_ - begin_ of the file
  std::size_t begin_ = 0;  // of the next line
  std::uint64_t at_ = 0, line_end_ = 0, row_ = 0;
  bool is_last_ = false;
};

}  // namespace

std::unique_ptr<PlyRows> PlyRows::open(PlyFile& file, const PlyHeader& header, const PlyElement& element,
                                       std::vector<const PlyProperty*> wanted, bool tells_rest) {
  if (element.has_list())
    fail(Status::format, "{}: element {} has the list {}: no 3DGS file", file.path(), element.name, element.list);
  if (header.format == PlyFormat::ascii) return std::make_unique<TextRows>(file, header, element, std::move(wanted));
  return std::make_unique<BinaryRows>(file, header, element, std::move(wanted), tells_rest);
}

}  // namespace vsplat
