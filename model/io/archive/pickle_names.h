// The opcodes and globals that pickles may contain.
#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

#include "runtime/files/safetensors.h"

namespace vsplat::pickle {

// The opcodes that the reader accepts.
enum class Opcode : std::uint8_t {
  mark = '(',
  stop = '.',
  bin_float = 'G',
  bin_int = 'J',
  bin_int1 = 'K',
  bin_int2 = 'M',
  none = 'N',
  bin_persid = 'Q',
  reduce = 'R',
  bin_unicode = 'X',
  empty_list = ']',
  append = 'a',
  build = 'b',
  global = 'c',
  appends = 'e',
  bin_get = 'h',
  long_bin_get = 'j',
  bin_put = 'q',
  long_bin_put = 'r',
  set_item = 's',
  tuple = 't',
  set_items = 'u',
  empty_tuple = ')',
  empty_dict = '}',
  proto = 0x80,
  tuple1 = 0x85,
  tuple2 = 0x86,
  tuple3 = 0x87,
  new_true = 0x88,
  new_false = 0x89,
  long1 = 0x8a
};

// Name of an opcode of any protocol, such as "INST"; null if the byte is no opcode.
const char* opcode_name(std::uint8_t opcode);

enum class Global : std::uint8_t {
  ordered_dict,
  rebuild_tensor,
  rebuild_parameter,
  storage,  // has a dtype
  inert     // occurs beside a state dict; what it makes is ignored
};

struct KnownGlobal {
  std::string_view name;  // "module name"
  Global what = Global::inert;
  Dtype dtype = Dtype::f32;
};

// Null for an unknown name.
const KnownGlobal* known_global(std::string_view name);

}  // namespace vsplat::pickle
