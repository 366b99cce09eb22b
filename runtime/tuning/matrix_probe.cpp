#include "runtime/tuning/matrix_probe.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "runtime/bfloat16.h"
#include "runtime/fail.h"
#include "runtime/gemm_matrix.h"
#include "runtime/gemm_pairs.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"
#include "runtime/system/environment.h"
#include "runtime/tuning/stored_finding.h"

namespace vsplat {
namespace {

struct ProbeSizes {
  long m, n, k;
};

// Numbers that bf16 represents exactly: of up to 8 bits, over several powers of two, or small integers.
std::vector<float> probe_numbers(long count, unsigned seed, bool whole) {
  std::mt19937 engine(seed);
  std::vector<float> out;
  for (long i = 0; i < count; ++i) {
    const float integer = static_cast<float>(static_cast<int>(engine() % 255) - 127);
    const int power = static_cast<int>(engine() % 9) - 8;
    out.push_back(whole ? std::trunc(integer / 8) : std::ldexp(integer, power));
  }
  return out;
}

float rounded(float x) { return from_bfloat16(to_bfloat16(x)); }

// out = x b, in the gpu flavour and in the cpu flavour.
std::function<void()> by_fragments(Context& ctx, const ProbeSizes& s, const Tensor& x, const std::vector<float>& b,
                                   const Tensor& out) {
  MatrixProducts p;
  p.a.x0 = x, p.src_rows = s.m, p.b = ctx.upload({s.k, s.n}, b), p.m = s.m, p.n = s.n, p.out = out;
  return [&ctx, p] { gemm_matrix(ctx, p); };
}

std::function<void()> by_pairs(Context& ctx, const ProbeSizes& s, const Tensor& x, const std::vector<float>& b,
                               const Tensor& out) {
  const PackedMatrix packed = pack_pairs(ctx, b.data(), s.k, s.n, s.n, 1, "B");
  return [&ctx, x, packed, out] {
    Gemm g;
    g.a.x0 = x, g.b = &packed, g.out = out;
    gemm(ctx, g);
  };
}

// Sums of integers must be exact; other sums must be within K roundings, which units may make coarser than a float's.
// Two runs must give the same bits.
std::string wrong_with(Context& ctx, const ProbeSizes& s, bool whole) {
  auto a = probe_numbers(s.m * s.k, 1, whole);
  const auto b = probe_numbers(s.k * s.n, 2, whole);
  // A processor's unit rounds by an instruction of its own: numbers that it must round, some of them half way.
  if (ctx.flavour() == Flavour::cpu && !whole)
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += std::ldexp(a[i], -8) * static_cast<float>(i % 3);
  const Tensor x = ctx.upload({s.m, s.k}, a);
  const Tensor out = ctx.upload({s.m, s.n}, std::vector<float>(static_cast<std::size_t>(s.m * s.n), NAN));
  const auto multiply = ctx.flavour() == Flavour::cpu ? by_pairs(ctx, s, x, b, out) : by_fragments(ctx, s, x, b, out);
  multiply();
  const auto got = ctx.read<float>(out);
  for (long i = 0; i < s.m * s.n; ++i) {
    double sum = 0, sizes = 0;
    for (long k = 0; k < s.k; ++k) {
      const double product = static_cast<double>(rounded(a[static_cast<std::size_t>(i / s.n * s.k + k)])) *
                             static_cast<double>(b[static_cast<std::size_t>(k * s.n + i % s.n)]);
      sum += product, sizes += std::abs(product);
    }
    const double is = got[static_cast<std::size_t>(i)], off = std::abs(is - sum);
    const double allowed = whole ? 0 : static_cast<double>(s.k) * std::ldexp(sizes, -23);
    if (!(off <= allowed))
      return fmt::format("of {} x {} x {} row {}, column {} is {}, {} expected", s.m, s.n, s.k, i / s.n, i % s.n, is,
                         sum);
  }
  multiply();
  if (ctx.read<float>(out) != got) return fmt::format("{} x {} x {}: other bits the second time", s.m, s.n, s.k);
  return "";
}

std::string subject_of(MatrixUnit unit) { return fmt::format("matrix units 1 {}", name_of(unit)); }

// The stored result: empty text if the unit is right.
std::optional<std::string> remembered(const DeviceInfo& device, MatrixUnit unit) {
  if (environment("VSPLAT_SELFTEST") == "ignore") return std::nullopt;
  try {
    const auto json = nlohmann::json::parse(stored_finding(stored_finding_path(device, subject_of(unit))).value_or(""));
    return json.at("wrong").get<std::string>();
  } catch (const nlohmann::json::exception&) {  // missing, or of another version
    return std::nullopt;
  } catch (const Error& e) {  // an unreadable file counts as no result
    verbose("{}", e.what());
    return std::nullopt;
  }
}

void remember_unit(const DeviceInfo& device, MatrixUnit unit, const std::string& wrong) {
  const nlohmann::ordered_json json{{"unit", name_of(unit)}, {"wrong", wrong},          {"date", today()},
                                    {"device", device.name}, {"driver", device.driver}, {"kernels", kernels_hash()}};
  const std::string path = stored_finding_path(device, subject_of(unit));
  if (path.empty()) return;
  try {
    keep_finding(path, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  } catch (const Error& e) {  // the trial is repeated next time
    warn("{}", e.what());
  }
}

// Runs in a separate context: a driver may discard a context that ran an unsupported instruction.
std::string tried(const DeviceInfo& device, MatrixUnit unit) {
  remember_unit(device, unit, "their test began and has not come to its end");
  std::string wrong;
  try {
    ContextOptions options;
    options.device = std::to_string(device.index);
    options.kernels = is_of_processor(unit) ? "cpu" : "gpu", options.matrix_unit = unit;
    Context ctx(options);
    wrong = wrong_with_matrix_unit(ctx);
  } catch (const Error& e) {
    wrong = printable(std::string(e.what()).substr(0, 400));
  }
  remember_unit(device, unit, wrong);
  if (!wrong.empty())
    warn("{}: its matrix units ({}) are not used, since their test failed: {}", device.name, name_of(unit), wrong);
  return wrong;
}

// Instructions that the processor lacks would end the process.
void refuse_absent(const DeviceInfo& device, MatrixUnit unit) {
  const auto& has = device.matrix_units;
  if (!is_of_processor(unit) || std::find(has.begin(), has.end(), unit) != has.end()) return;
  if (device.type != DeviceType::cpu)
    fail(Status::device, "VSPLAT_MATRIX={}: {} is no CPU device, and the instructions are a processor's", name_of(unit),
         device.name);
  fail(Status::device, "VSPLAT_MATRIX={}: {}", name_of(unit),
       unit == MatrixUnit::avx512bf16 ? "this processor has no avx512_bf16 instructions (vdpbf16ps)"
                                      : "this processor has no amx_bf16 instructions (tdpbf16ps), or the system does "
                                        "not let programs use them (Linux does from 5.16 on)");
}

std::vector<MatrixUnit> units_to_try(const DeviceInfo& device) {
  const std::string named = environment("VSPLAT_MATRIX");
  if (named.empty()) return device.matrix_units;
  std::vector<MatrixUnit> out;
  for (std::size_t from = 0; from <= named.size();) {
    const std::size_t end = std::min(named.find(',', from), named.size());
    const std::string name = named.substr(from, end - from);
    for (const MatrixUnit unit : kMatrixUnits) {
      if (name != name_of(unit)) continue;
      refuse_absent(device, unit);
      if (unit != MatrixUnit::emulated) out.push_back(unit);
    }
    from = end + 1;
  }
  return out;
}

}  // namespace

std::string wrong_with_matrix_unit(Context& ctx) {
  const long wide = 128L * 2 * ctx.device().compute_units + 1;  // enough for the largest tiles
  for (const ProbeSizes& s : {ProbeSizes{1, 1, 1},
                              {3, 7, 5},
                              {16, 8, 16},
                              {17, 9, 33},
                              {31, 101, 67},
                              {65, 63, 129},
                              {64, 64, 64},
                              {33, 65, 1031},
                              {wide, 131, 35},
                              {wide, 132, 36}})
    for (const bool whole : {true, false})
      if (std::string wrong = wrong_with(ctx, s, whole); !wrong.empty()) return wrong;
  return "";
}

MatrixUnit choose_matrix_unit(const DeviceInfo& device, const std::string& kernels, const SwitchedOff& off) {
  for (const MatrixUnit unit : units_to_try(device)) {
    if (kernels == (is_of_processor(unit) ? "gpu" : "cpu") || (is_of_processor(unit) && (off.cpu || off.vectors)))
      continue;
    std::optional<std::string> wrong = remembered(device, unit);
    if (!wrong) wrong = tried(device, unit);
    if (wrong->empty()) return unit;
    verbose("{}: matrix units ({}) not used: {}", device.name, name_of(unit), *wrong);
  }
  if (kernels == "cpu" && environment("VSPLAT_MATRIX").empty())
    fail(Status::usage,
         "mixed precision and the cpu kernels were asked for, and these multiply in mixed precision by a processor's "
         "avx512_bf16 or amx_bf16 instructions, which {} does not have or which have not passed their test there: ask "
         "for the gpu kernels, or leave the choice to the program ({}, VSPLAT_KERNELS), or take fp32",
         device.name, Option::kernels);
  return MatrixUnit::emulated;
}

}  // namespace vsplat
