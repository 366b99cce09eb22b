#include "runtime/files/base64.h"

#include <openssl/evp.h>

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

}  // namespace vsplat
