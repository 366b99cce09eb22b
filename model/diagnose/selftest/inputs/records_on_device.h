// Records in tiles, as blending takes them.
#pragma once
#include "model/diagnose/selftest/inputs/records.h"
#include "model/ops/render/project.h"
#include "model/ops/render/tile_bin.h"

namespace vsplat::selftest {

struct RecordsOnDevice {
  Projected p;
  Binned b;
  std::vector<std::uint32_t> slots;
};

// `numbers`: of a record.
inline RecordsOnDevice upload_records(Context& ctx, const Records& r, std::size_t numbers = 12) {
  const auto list = [&](const std::vector<std::uint32_t>& v) {
    return ctx.upload({static_cast<long>(v.size())}, v, Type::u32);
  };
  RecordsOnDevice out;
  out.slots = slots_of(r, numbers);
  const long each = static_cast<long>(numbers);
  out.p.records = ctx.upload({static_cast<long>(r.records.size()) / each, each}, r.records);
  out.b.ids = list(r.ids), out.b.starts = list(r.starts), out.b.slots = list(out.slots);
  return out;
}

// None of no values.
inline Tensor upload_or_none(Context& ctx, const std::vector<float>& v, const Shape& shape) {
  return v.empty() ? Tensor() : ctx.upload(shape, v);
}

}  // namespace vsplat::selftest
