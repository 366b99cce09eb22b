// Messages between the library and its reader (reader/program/): a kind and a body of numbers and texts. The reader has
// parsed an untrusted file, so everything it sends is checked like an untrusted file.
#pragma once
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace vsplat::read {

// Sent in the reader's first message; the library refuses any other version.
std::string version();

enum class Kind : std::uint32_t {
  // Sent by the library.
  mesh = 1,  // seconds (u32), path
  hdf5,      // seconds, path: the file stays open and can be queried:
  links,     // seconds, group
  shape,     // seconds, array
  bytes,     // seconds, array, shape
  numbers,   // seconds, array, shape
  answer,    // to `exists` and `open`: u32, whether; with the file

  // Sent by the reader.
  hello = 100,  // version, u32: active measures (Confinement)
  exists,       // a path that the file refers to
  open,         // a path to open; the reader itself opens nothing
  failed,       // Status (u32), place in the file, what is wrong; ends the request
  part,         // of a mesh: MeshPart
  corners,      // of the triangles of the last part: 3 n x MeshCorner
  texture,      // name, an encoded picture
  materials,    // u32 count, that many MeshMaterials
  listed,       // u32 count, that many times: name, target file
  values,       // of an array: its shape, or its values
  done,         // ends the request
  note          // of a mesh: information for the user that needs no action
};

struct Header {
  std::uint32_t magic;
  Kind kind;
  std::uint64_t size;  // of the body
};
inline constexpr std::uint32_t magic = 0x52505356;  // "VSPR"

struct Message {
  Kind kind{};
  std::vector<char> body;
};

// Thrown if the received data are no message, or not an expected one.
struct BadMessage : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Writes a message body.
class Packer {
 public:
  Packer() = default;
  explicit Packer(std::vector<char> body) : body_(std::move(body)) {}
  template <class T>
  Packer& put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    return raw(&value, sizeof value);
  }
  Packer& text(std::string_view value);
  Packer& shape(const std::vector<long>& sides);
  Packer& raw(const void* data, std::size_t size);
  const std::vector<char>& body() const { return body_; }

 private:
  std::vector<char> body_;
};

// Reads a message body. Each call throws BadMessage if the body does not contain what is requested.
class Unpacker {
 public:
  explicit Unpacker(const std::vector<char>& body) : body_(body.data(), body.size()) {}
  explicit Unpacker(std::string_view body) : body_(body) {}

  template <class T>
  T get() {
    static_assert(std::is_arithmetic_v<T>);
    T out;
    std::memcpy(&out, take(sizeof out).data(), sizeof out);
    return out;
  }
  bool flag() { return get<std::uint32_t>() != 0; }
  std::string text(std::size_t most = 4096);
  std::vector<long> shape();  // at most eight sides, all non-negative
  std::string_view rest() { return take(body_.size()); }
  std::size_t left() const { return body_.size(); }
  void end() const;  // checks that nothing is left

 private:
  std::string_view take(std::size_t size);
  std::string_view body_;
};

}  // namespace vsplat::read
