// Encodes bytes as text (RFC 4648, with padding), with libcrypto.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

std::string base64(const std::vector<unsigned char>& bytes);

}  // namespace vsplat
