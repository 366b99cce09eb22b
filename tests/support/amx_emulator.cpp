#include "tests/support/amx_emulator.h"

#if defined(__x86_64__) && defined(__linux__)
#include <ucontext.h>

#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>

namespace vsplat::test {
namespace {

struct Tile {
  unsigned rows, bytes;  // of a row
  std::array<std::array<std::uint8_t, 64>, 16> data;
};

struct Unit {
  bool ready;
  std::array<Tile, 8> tiles;
};

thread_local Unit unit;
std::atomic<long> computed{0};

struct Instruction {
  unsigned opcode, prefix, reg, rm, vvvv, size;
  bool memory;
  std::uint64_t address, stride;
};

std::uint64_t register_of(const ucontext_t& at, unsigned number) {
  constexpr std::array<int, 16> places = {REG_RAX, REG_RCX, REG_RDX, REG_RBX, REG_RSP, REG_RBP, REG_RSI, REG_RDI,
                                          REG_R8,  REG_R9,  REG_R10, REG_R11, REG_R12, REG_R13, REG_R14, REG_R15};
  return static_cast<std::uint64_t>(at.uc_mcontext.gregs[places[number]]);
}

// Instructions with a VEX prefix of three bytes, of the map 0F38 and 128 bits. False: another one.
bool decode(const ucontext_t& at, Instruction* i) {
  const auto* code = reinterpret_cast<const std::uint8_t*>(at.uc_mcontext.gregs[REG_RIP]);
  if (code[0] != 0xc4 || (code[1] & 0x1f) != 2 || (code[2] & 0x84) != 0) return false;
  const unsigned extend_reg = code[1] & 0x80 ? 0 : 8, extend_index = code[1] & 0x40 ? 0 : 8,
                 extend_base = code[1] & 0x20 ? 0 : 8;
  i->prefix = code[2] & 3, i->vvvv = ~(code[2] >> 3u) & 15, i->opcode = code[3];
  const unsigned mod = code[4] >> 6u, rm = code[4] & 7;
  i->reg = (code[4] >> 3u & 7) + extend_reg, i->rm = rm + extend_base;
  i->memory = mod != 3, i->size = 5;
  if (!i->memory) return true;
  unsigned base = i->rm;
  i->stride = 0;
  if (rm == 4) {
    const unsigned sib = code[i->size++], index = (sib >> 3u & 7) + extend_index;
    base = (sib & 7) + extend_base;
    if (index != 4) i->stride = register_of(at, index) << (sib >> 6u);
  }
  if (mod == 0 && (base & 7) == 5) return false;  // an address without a base
  i->address = register_of(at, base);
  if (mod == 1) i->address += static_cast<std::uint64_t>(static_cast<std::int8_t>(code[i->size++]));
  if (mod == 2) {
    std::int32_t shift = 0;
    std::memcpy(&shift, code + i->size, 4);
    i->address += static_cast<std::uint64_t>(shift), i->size += 4;
  }
  return true;
}

bool configure(const std::uint8_t* from) {
  Unit next{};
  if (from[0] != 1 || from[1] != 0) return false;
  for (int i = 2; i < 64; ++i)
    if ((i < 16 || (i >= 32 && i < 48) || i >= 56) && from[i] != 0) return false;
  for (std::size_t t = 0; t < 8; ++t) {
    next.tiles[t].bytes = from[16 + 2 * t] + 256u * from[17 + 2 * t], next.tiles[t].rows = from[48 + t];
    if (next.tiles[t].bytes > 64 || next.tiles[t].bytes % 4 != 0 || next.tiles[t].rows > 16) return false;
  }
  next.ready = true;
  unit = next;
  return true;
}

float flushed(float x) { return std::abs(x) < 0x1p-126f ? std::copysign(0.0f, x) : x; }

float number_at(const Tile& t, unsigned row, unsigned place) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, t.data[row].data() + 2 * place, 2);
  bits <<= 16u;
  float x = 0;
  std::memcpy(&x, &bits, 4);
  return flushed(x);
}

bool multiply(Tile& sum, const Tile& a, const Tile& b) {
  if (sum.bytes != b.bytes || sum.rows != a.rows || a.bytes / 4 != b.rows || sum.rows == 0 || sum.bytes == 0)
    return false;
  for (unsigned m = 0; m < sum.rows; ++m)
    for (unsigned n = 0; n < sum.bytes / 4; ++n) {
      float parts[2] = {0, 0}, total = 0;
      for (unsigned k = 0; k < b.rows; ++k)
        for (unsigned j = 0; j < 2; ++j)
          parts[j] = flushed(std::fma(number_at(a, m, 2 * k + j), number_at(b, k, 2 * n + j), parts[j]));
      std::memcpy(&total, sum.data[m].data() + 4 * n, 4);
      total = flushed(flushed(total) + flushed(parts[0] + parts[1]));
      std::memcpy(sum.data[m].data() + 4 * n, &total, 4);
    }
  return true;
}

bool compute(const Instruction& i) {
  if (i.opcode == 0x49 && i.prefix == 0 && i.memory)
    return i.reg == 0 && configure(reinterpret_cast<const std::uint8_t*>(i.address));
  if (i.reg > 7 || !unit.ready) return false;
  Tile& tile = unit.tiles[i.reg];
  if (i.opcode == 0x49 && i.prefix == 0 && i.reg == 0 && i.rm == 0) return unit = Unit{}, true;  // tilerelease
  if (i.opcode == 0x49 && i.prefix == 3 && !i.memory) return tile.data = {}, tile.rows > 0;      // tilezero
  if (i.opcode == 0x4b && i.memory && tile.rows > 0) {
    if (i.prefix == 3) tile.data = {};
    for (unsigned row = 0; row < tile.rows; ++row) {
      auto* at = reinterpret_cast<std::uint8_t*>(i.address + row * i.stride);
      if (i.prefix == 3) std::memcpy(tile.data[row].data(), at, tile.bytes);  // tileloadd
      if (i.prefix == 2) std::memcpy(at, tile.data[row].data(), tile.bytes);  // tilestored
    }
    return i.prefix >= 2;
  }
  if (i.opcode != 0x5c || i.prefix != 2 || i.memory || i.rm > 7 || i.vvvv > 7) return false;
  if (i.reg == i.rm || i.reg == i.vvvv || i.rm == i.vvvv) return false;
  return multiply(tile, unit.tiles[i.rm], unit.tiles[i.vvvv]);  // tdpbf16ps
}

extern "C" void illegal_instruction(int number, siginfo_t*, void* context) {
  auto& at = *static_cast<ucontext_t*>(context);
  Instruction i{};
  if (!decode(at, &i) || !compute(i)) {
    std::signal(number, SIG_DFL);  // it is raised again
    return;
  }
  at.uc_mcontext.gregs[REG_RIP] += i.size;
  ++computed;
}

}  // namespace

bool emulate_amx() {
  struct sigaction action {};
  action.sa_sigaction = illegal_instruction;
  action.sa_flags = SA_SIGINFO;
  return sigaction(SIGILL, &action, nullptr) == 0;
}

long emulated_instructions() { return computed; }

}  // namespace vsplat::test

#else

namespace vsplat::test {
bool emulate_amx() { return false; }
long emulated_instructions() { return 0; }
}  // namespace vsplat::test

#endif
