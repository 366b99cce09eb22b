// Bytes as text (RFC 4648, with padding), with libcrypto.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vsplat {

std::string base64(const std::vector<unsigned char>& bytes);
// Nothing if the text is not valid: every group of four characters is needed, with padding at the end alone.
std::optional<std::vector<unsigned char>> from_base64(std::string_view text);

}  // namespace vsplat
