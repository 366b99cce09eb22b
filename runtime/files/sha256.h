// SHA-256 of the bytes added, with OpenSSL's libcrypto.
#pragma once
#include <cstddef>
#include <memory>
#include <string>

namespace vsplat {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  void add(const void* data, std::size_t bytes);
  std::string hex();  // 64 lower-case digits; ends the computation

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace vsplat
