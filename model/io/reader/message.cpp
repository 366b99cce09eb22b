#include "model/io/reader/message.h"

#include <fmt/format.h>

namespace vsplat::read {

std::string version() { return VSPLAT_VERSION " 2"; }  // of the library and of the protocol

Packer& Packer::raw(const void* data, std::size_t size) {
  const auto* bytes = static_cast<const char*>(data);
  body_.insert(body_.end(), bytes, bytes + size);
  return *this;
}

Packer& Packer::text(std::string_view value) {
  return put(static_cast<std::uint64_t>(value.size())).raw(value.data(), value.size());
}

Packer& Packer::shape(const std::vector<long>& sides) {
  put(static_cast<std::uint32_t>(sides.size()));
  for (const long side : sides) put(static_cast<std::int64_t>(side));
  return *this;
}

std::string_view Unpacker::take(std::size_t size) {
  if (size > body_.size()) throw BadMessage(fmt::format("{} bytes where {} are left", size, body_.size()));
  const std::string_view out = body_.substr(0, size);
  body_.remove_prefix(size);
  return out;
}

std::string Unpacker::text(std::size_t most) {
  const auto size = get<std::uint64_t>();
  if (size > most) throw BadMessage(fmt::format("a text of {} bytes, at most {} are possible", size, most));
  return std::string(take(static_cast<std::size_t>(size)));
}

std::vector<long> Unpacker::shape() {
  const auto sides = get<std::uint32_t>();
  if (sides > 8) throw BadMessage(fmt::format("an array of {} sides, at most 8 are possible", sides));
  std::vector<long> out;
  for (std::uint32_t i = 0; i < sides; ++i) {
    out.push_back(static_cast<long>(get<std::int64_t>()));
    if (out.back() < 0) throw BadMessage(fmt::format("a side of {}", out.back()));
  }
  return out;
}

void Unpacker::end() const {
  if (!body_.empty()) throw BadMessage(fmt::format("{} bytes too many", body_.size()));
}

}  // namespace vsplat::read
