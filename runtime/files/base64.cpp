#include "runtime/files/base64.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cstddef>
#include <limits>

#include "runtime/fail.h"

namespace vsplat {

std::string base64(const std::vector<unsigned char>& bytes) {
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max() / 2))
    fail(Status::internal, "{} bytes as base64: at most a GiB is possible", bytes.size());
  std::string out((bytes.size() + 2) / 3 * 4 + 1, 0);  // and a terminating 0
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(out.data()), bytes.data(), static_cast<int>(bytes.size()));
  out.resize(static_cast<std::size_t>(length));
  return out;
}

std::optional<std::vector<unsigned char>> from_base64(std::string_view text) {
  // libcrypto would also skip white space at both ends, and accept padding anywhere.
  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  const bool plain = std::all_of(text.begin(), text.end() - static_cast<std::ptrdiff_t>(padding), [](unsigned char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
  });
  if (!plain || text.size() % 4 != 0) return std::nullopt;
  std::vector<unsigned char> out(text.size() / 4 * 3);
  constexpr std::size_t piece = std::size_t{4} << 20;  // libcrypto counts with ints
  for (std::size_t at = 0; at < text.size(); at += piece)
    if (EVP_DecodeBlock(&out[at / 4 * 3], reinterpret_cast<const unsigned char*>(text.data()) + at,
                        static_cast<int>(std::min(piece, text.size() - at))) < 0)
      return std::nullopt;
  out.resize(out.size() - padding);
  return out;
}

}  // namespace vsplat
