#include "runtime/files/base64.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cstddef>

namespace vsplat {

namespace {

// libcrypto counts with ints, so long texts are converted in pieces: of 3 MiB of bytes, and of 4 MiB of text.
constexpr std::size_t kBytesAtOnce = std::size_t{3} << 20, kTextAtOnce = std::size_t{4} << 20;

}  // namespace

std::string base64(const std::vector<unsigned char>& bytes) {
  std::string out((bytes.size() + 2) / 3 * 4 + 1, 0);  // and a terminating 0
  for (std::size_t at = 0; at < bytes.size(); at += kBytesAtOnce)
    EVP_EncodeBlock(reinterpret_cast<unsigned char*>(&out[at / 3 * 4]), &bytes[at],
                    static_cast<int>(std::min(kBytesAtOnce, bytes.size() - at)));
  out.pop_back();
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
  for (std::size_t at = 0; at < text.size(); at += kTextAtOnce)
    if (EVP_DecodeBlock(&out[at / 4 * 3], reinterpret_cast<const unsigned char*>(text.data()) + at,
                        static_cast<int>(std::min(kTextAtOnce, text.size() - at))) < 0)
      return std::nullopt;
  out.resize(out.size() - padding);
  return out;
}

}  // namespace vsplat
