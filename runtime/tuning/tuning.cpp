#include "runtime/tuning/tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "runtime/context.h"
#include "runtime/fail.h"
#include "runtime/files/sha256.h"

namespace vsplat {

const std::vector<TunedDeclaration>& tuned_declarations() {
  const TunedParameter tile{
      "tile", "side of a group's square tile; 0: 128 where there are enough of them", {0, 64, 128}};
  const TunedParameter unroll{
      "unroll", "steps of k that are one turn of the loop; 0: 2 of the large tile, 4 of the small", {0, 1, 2, 4, 8}};
  const std::vector<TunedSize> matrix{{"m", true}, {"n"}, {"k"}, {"taps"}}, volume{{"voxels", true}, {"cin"}, {"cout"}},
      tokens{{"heads", true}, {"tokens", true}, {"channels"}};
  const TunedParameter rows{"rows", "tokens of a register tile; 0: 12, or 2 where there are no vectors", {0, 4, 6, 8}};
  const TunedParameter panels{"panels", "of 32 tokens in a step of the running softmax", {4, 1, 2, 8}};
  static const auto& all = *new std::vector<TunedDeclaration>{
      {TunedOp::gemm,
       "gemm",
       Flavour::gpu,
       matrix,
       {tile, unroll, {"split", "parts of a sum, side by side, which are added up in order", {1, 2, 4, 8}}}},
      {TunedOp::gemm,
       "gemm",
       Flavour::cpu,
       matrix,
       {{"block",
         "numbers of A that each panel of B is multiplied with",
         {128 << 10, 16 << 10, 32 << 10, 64 << 10, 256 << 10}},
        {"scratch", "numbers of A that are packed at a time", {2 << 20, 512 << 10, 1 << 20, 4 << 20}}}},
      {TunedOp::gemm_transposed, "gemm_transposed", Flavour::gpu, {{"rows", true}, {"m"}, {"n"}}, {tile, unroll}},
      {TunedOp::gemm_transposed,
       "gemm_transposed",
       Flavour::cpu,
       {{"rows", true}, {"m"}, {"n"}},
       {{"terms", "rows whose products are one sum", {1024, 512, 2048}},
        {"block", "panels of a work-item", {1, 2, 4}}}},
      {TunedOp::conv3d, "conv3d", Flavour::gpu, volume, {tile, unroll}},
      {TunedOp::conv3d,
       "conv3d",
       Flavour::cpu,
       volume,
       {{"scratch", "numbers of packed planes at a time", {4 << 20, 1 << 20, 2 << 20, 8 << 20}}}},
      {TunedOp::conv3d_winograd,
       "conv3d_winograd",
       Flavour::cpu,
       volume,
       {{"scratch", "numbers of transformed tiles at a time", {4 << 20, 1 << 20, 2 << 20, 8 << 20}}}},
      {TunedOp::conv3d_winograd,
       "conv3d_winograd",
       Flavour::gpu,
       volume,
       {{"scratch", "numbers of transformed tiles, and of their products, at a time", {16 << 20, 4 << 20, 64 << 20}},
        tile,
        unroll}},
      {TunedOp::conv3d_method,
       "conv3d_method",
       Flavour::gpu,
       {{"cin"}, {"cout"}},
       {{"method", "1 the direct sum, 2 Winograd's; 0: Winograd's from 64 channels on", {0, 1, 2}}}},
      {TunedOp::conv3d_method,
       "conv3d_method",
       Flavour::cpu,
       {{"cin"}, {"cout"}},
       {{"method", "1 the direct sum, 2 Winograd's; 0: Winograd's from 32 channels on", {0, 1, 2}}}},
      {TunedOp::conv3d_weights,
       "conv3d_weights",
       Flavour::gpu,
       volume,
       {{"tile", "side of a group's square tile", {64, 128}}, unroll}},
      {TunedOp::attention_forward, "attention_forward", Flavour::cpu, tokens, {rows, panels}},
      {TunedOp::attention_backward, "attention_backward", Flavour::cpu, tokens, {rows, panels}},
      {TunedOp::radix_sort,
       "radix_sort",
       Flavour::gpu,
       {{"keys", true}, {"bits"}},
       {{"digit", "bits of a pass, at the most", {4, 3, 5, 6}},
        {"group", "work-items of a group", {64, 32, 128}},
        {"run", "keys of a work-item", {16, 4, 8, 32}}}},
      {TunedOp::radix_sort,
       "radix_sort",
       Flavour::cpu,
       {{"keys", true}, {"bits"}},
       {{"digit", "bits of a pass, at the most", {8, 6, 10, 11}},
        {"blocks", "of keys for each compute unit", {4, 2, 8}}}},
      {TunedOp::rasterize_forward,
       "rasterize_forward",
       Flavour::gpu,
       {{"tiles", true}, {"intersections", true}},
       {{"pixels", "of a work-item, at the least", {1, 2, 4, 8}}}},
      {TunedOp::rasterize_forward,
       "rasterize_forward",
       Flavour::cpu,
       {{"tiles", true}, {"intersections", true}},
       {{"batch", "Gaussians of a tile that a work-item looks at together", {64, 32, 128}}}},
  };
  return all;
}

const TunedDeclaration* tuned_declaration(TunedOp op, Flavour flavour) {
  for (const TunedDeclaration& one : tuned_declarations())
    if (one.op == op && one.flavour == flavour) return &one;
  return nullptr;
}

const TunedDeclaration* tuned_declaration(const std::string& name, Flavour flavour) {
  for (const TunedDeclaration& one : tuned_declarations())
    if (one.name == name && one.flavour == flavour) return &one;
  return nullptr;
}

TunedShape class_of(const TunedDeclaration& of, const TunedShape& shape) {
  TunedShape out = shape;
  for (std::size_t i = 0; i < of.sizes.size(); ++i) {
    if (!of.sizes[i].rounded) continue;
    long power = 1;
    while (power < shape.sizes[i] && power < (1L << 40)) power *= 2;
    out.sizes[i] = power;
  }
  return out;
}

std::string text_of(const TunedDeclaration& of, const TunedShape& shape) {
  std::string out = of.name;
  for (std::size_t i = 0; i < of.sizes.size(); ++i) out += fmt::format(" {}={}", of.sizes[i].name, shape.sizes[i]);
  return out;
}

long TunedValues::at(const char* name) const {
  for (std::size_t i = 0; of && i < of->parameters.size(); ++i)
    if (std::strcmp(of->parameters[i].name, name) == 0) return values[i];
  fail(Status::internal, "{} has no parameter {}", of ? of->name : "an operation that is not declared", name);
}

TunedValues default_values(const TunedDeclaration& of) {
  TunedValues out{&of, {}};
  for (std::size_t i = 0; i < of.parameters.size(); ++i) out.values[i] = of.parameters[i].values.front();
  return out;
}

std::string text_of(const TunedValues& values) {
  std::string out;
  for (std::size_t i = 0; values.of && i < values.of->parameters.size(); ++i)
    out += fmt::format("{}{}={}", i > 0 ? " " : "", values.of->parameters[i].name, values.values[i]);
  return out;
}

std::string name_of_choice(const TunedShape& shape, const TunedValues& values) {
  return fmt::format("{} {}, {}", name_of(values.of->flavour), text_of(*values.of, shape), text_of(values));
}

std::vector<TunedValues> all_values(const TunedDeclaration& of) {
  std::vector<TunedValues> out{default_values(of)};
  for (std::size_t i = 0; i < of.parameters.size(); ++i) {
    const std::size_t before = out.size();
    for (std::size_t v = 1; v < of.parameters[i].values.size(); ++v)
      for (std::size_t j = 0; j < before; ++j) {
        out.push_back(out[j]);
        out.back().values[i] = of.parameters[i].values[v];
      }
  }
  return out;
}

TunedValues Tuning::values(Flavour flavour, const TunedShape& shape) const {
  if (const auto& forced = forced_[static_cast<std::size_t>(shape.op)]; forced && forced->of->flavour == flavour)
    return *forced;
  const TunedDeclaration* of = tuned_declaration(shape.op, flavour);
  if (!of) return {};
  if (!chosen_.empty())
    if (const auto it = chosen_.find(class_of(*of, shape)); it != chosen_.end() && it->second.of == of)
      return it->second;
  return default_values(*of);
}

void Tuning::set(const TunedShape& shape, const TunedValues& values) {
  const TunedShape key = class_of(*values.of, shape);
  if (values == default_values(*values.of))
    chosen_.erase(key);
  else
    chosen_[key] = values;
}

bool Tuning::refuse(Flavour flavour, const std::vector<std::string>& names) {
  bool out = false;
  for (const std::string& name : names) {
    if (!name.starts_with(std::string(name_of(flavour)) + " ")) continue;
    const std::string shape = name.substr(0, name.find(", ") + 2);
    const auto of_that_shape = std::find_if(chosen_.begin(), chosen_.end(), [&](const auto& one) {
      return name_of_choice(one.first, one.second).starts_with(shape);
    });
    const bool another =
        of_that_shape != chosen_.end() && name_of_choice(of_that_shape->first, of_that_shape->second) != name;
    if (of_that_shape != chosen_.end() && !another) chosen_.erase(of_that_shape);
    out = out || !another;
  }
  return out;
}

void Tuning::force(TunedOp op, const TunedValues& values) { forced_[static_cast<std::size_t>(op)] = values; }

std::string Tuning::hash() const {
  if (chosen_.empty()) return "";
  std::string text;
  for (const auto& [shape, values] : chosen_)
    text += fmt::format("{} {}: {}\n", name_of(values.of->flavour), text_of(*values.of, shape), text_of(values));
  Sha256 hash;
  hash.add(text.data(), text.size());
  return hash.hex();
}

}  // namespace vsplat
