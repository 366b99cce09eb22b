#include "runtime/tuning/matrix_probe.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "runtime/fail.h"
#include "runtime/gemm_matrix.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/system/environment.h"
#include "runtime/tuning/kept_finding.h"

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

// Sums of integers must be exact; other sums must be within K roundings, which units may make coarser than a float's.
// Two runs must give the same bits.
std::string wrong_with(Context& ctx, const ProbeSizes& s, bool whole) {
  const auto a = probe_numbers(s.m * s.k, 1, whole), b = probe_numbers(s.k * s.n, 2, whole);
  MatrixProducts p;
  p.a.x0 = ctx.upload({s.m, s.k}, a), p.src_rows = s.m;
  p.b = ctx.upload({s.k, s.n}, b), p.m = s.m, p.n = s.n;
  p.out = ctx.upload({s.m, s.n}, std::vector<float>(static_cast<std::size_t>(s.m * s.n), NAN));
  gemm_matrix(ctx, p);
  const auto got = ctx.read<float>(p.out);
  for (long i = 0; i < s.m * s.n; ++i) {
    double sum = 0, sizes = 0;
    for (long k = 0; k < s.k; ++k) {
      const double product = static_cast<double>(a[static_cast<std::size_t>(i / s.n * s.k + k)]) *
                             static_cast<double>(b[static_cast<std::size_t>(k * s.n + i % s.n)]);
      sum += product, sizes += std::abs(product);
    }
    const double is = got[static_cast<std::size_t>(i)], off = std::abs(is - sum);
    const double allowed = whole ? 0 : static_cast<double>(s.k) * std::ldexp(sizes, -23);
    if (!(off <= allowed))
      return fmt::format("of {} x {} x {} row {}, column {} is {}, {} expected", s.m, s.n, s.k, i / s.n, i % s.n, is,
                         sum);
  }
  gemm_matrix(ctx, p);
  if (ctx.read<float>(p.out) != got) return fmt::format("{} x {} x {}: other bits the second time", s.m, s.n, s.k);
  return "";
}

std::string subject_of(MatrixUnit unit) { return fmt::format("matrix units 1 {}", name_of(unit)); }

// The stored result: empty text if the unit is right.
std::optional<std::string> remembered(const DeviceInfo& device, MatrixUnit unit) {
  if (environment("VSPLAT_SELFTEST") == "ignore") return std::nullopt;
  try {
    const auto json = nlohmann::json::parse(kept_finding(kept_finding_path(device, subject_of(unit))).value_or(""));
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
  const std::string path = kept_finding_path(device, subject_of(unit));
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
    options.kernels = "gpu", options.matrix_unit = unit;
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

std::vector<MatrixUnit> units_to_try(const DeviceInfo& device) {
  const std::string named = environment("VSPLAT_MATRIX");
  if (named.empty()) return device.matrix_units;
  std::vector<MatrixUnit> out;
  for (std::size_t from = 0; from <= named.size();) {
    const std::size_t end = std::min(named.find(',', from), named.size());
    const std::string name = named.substr(from, end - from);
    bool known = false;
    for (const MatrixUnit unit : kMatrixUnits)
      if (name == name_of(unit)) {
        known = true;
        if (unit != MatrixUnit::emulated) out.push_back(unit);
      }
    if (!known)
      fail(Status::usage, "VSPLAT_MATRIX={}: \"{}\" is none of emulated, ptx, dpas, wmma and mfma", printable(named),
           printable(name));
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
                              {wide, 131, 35},
                              {wide, 132, 36}})
    for (const bool whole : {true, false})
      if (std::string wrong = wrong_with(ctx, s, whole); !wrong.empty()) return wrong;
  return "";
}

MatrixUnit choose_matrix_unit(const DeviceInfo& device) {
  for (const MatrixUnit unit : units_to_try(device)) {
    std::optional<std::string> wrong = remembered(device, unit);
    if (!wrong) wrong = tried(device, unit);
    if (wrong->empty()) return unit;
    verbose("{}: matrix units ({}) not used: {}", device.name, name_of(unit), *wrong);
  }
  return MatrixUnit::emulated;
}

}  // namespace vsplat
