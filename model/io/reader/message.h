// What the library and its reader (read/program/) tell each other: messages of a kind, their bodies made of numbers and
// texts. The reader has read a stranger's file: whatever it says is checked like a stranger's file.
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

// The reader says it in its first message, and the library takes no other.
std::string version();

enum class Kind : std::uint32_t {
  // From the library.
  mesh = 1,  // seconds (u32), path
  hdf5,      // seconds, path: the file stays open, and may be asked:
  links,     // seconds, group
  shape,     // seconds, array
  bytes,     // seconds, array, shape
  numbers,   // the same
  answer,    // to `exists` and `open`: u32, whether; with the file

  // From the reader.
  hello = 100,  // version, u32: what confines it (Confinement)
  exists,       // a path that a file names
  open,         // the same; it opens nothing itself
  failed,       // Status (u32), place in the file, what is wrong: the end of what was asked
  part,         // of a mesh: MeshPart
  corners,      // of the triangles of the part that came before: 3 n x MeshCorner
  texture,      // name, an encoded picture
  materials,    // u32, so many MeshMaterials
  listed,       // u32, so many times: name, file that it leads to
  values,       // of an array: shape, or its values
  done,         // the end of what was asked
  note          // of a mesh: what the user should know and need not act on
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

// What came is no message, or not one that is expected.
struct BadMessage : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A body, written.
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

// A body, read. Each throws BadMessage where it has not what is asked for.
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
  std::vector<long> shape();  // at most eight sides, none of them negative
  std::string_view rest() { return take(body_.size()); }
  std::size_t left() const { return body_.size(); }
  void end() const;  // there is nothing left

 private:
  std::string_view take(std::size_t size);
  std::string_view body_;
};

}  // namespace vsplat::read
