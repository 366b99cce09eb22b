#include "model/networks/params/load_encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string_view>
#include <type_traits>

#include "model/base/rope_periods.h"
#include "model/networks/params/match_tensors.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr const char* kPrefixes[] = {"",          "model.",  "encoder.model.",  "net.encoder.model.",
                                     "backbone.", "module.", "module.backbone."};

// The prefix of the encoder's parameter names.
std::string encoder_of(const AnyConfig& config) {
  return config.visit(
      [](const auto& c) { return SystemOf<std::decay_t<decltype(c)>>::modules[0] + std::string("model."); });
}

bool is_head(std::string_view name) { return name.starts_with("head.") || name.starts_with("fc_norm."); }

// An encoder's tensors in a file, by timm's names, in either naming.
template <class File>
class EncoderIn {
 public:
  explicit EncoderIn(const File& file) : file_(file) {
    const auto found = std::find_if(std::begin(kPrefixes), std::end(kPrefixes), [&](const char* prefix) {
      return file.find(std::string(prefix) + "cls_token") != nullptr;
    });
    if (found == std::end(kPrefixes))
      fail(Status::format,
           "{}: no cls_token, with or without the prefixes model., encoder.model., net.encoder.model., backbone., "
           "module., module.backbone.: not a ViT in timm's or Meta's naming",
           file.path());
    prefix_ = *found;
    meta_ = find("storage_tokens") != nullptr;
    config_.encoder = meta_ || find("reg_token") != nullptr || find("blocks.0.gamma_1") != nullptr ? "dinov3" : "dino";
    tell();
  }

  const Config& config() const { return config_; }
  bool dinov3() const { return config_.encoder == "dinov3"; }

  // The values of the parameter called `bare` within the encoder; marks the entries they come from as used.
  HostTensor values(const Parameter& p, const std::string& bare) {
    const bool query = bare.ends_with("attn.q_bias");
    if (meta_ && (query || bare.ends_with("attn.v_bias"))) {
      const std::string attention = bare.substr(0, bare.rfind('.'));
      file_.at(prefix_ + attention + ".qkv.bias");  // if one block has it, all must
      const std::vector<float> all = bias(attention);
      const auto third = static_cast<std::ptrdiff_t>(all.size() / 3), first = query ? 0 : 2 * third;
      return {p.shape, {all.begin() + first, all.begin() + first + third}};
    }
    const TensorEntry& entry = file_.at(prefix_ + in_file(bare));
    require_weights(file_.path(), entry, p);
    used_.insert(entry.name);
    return {p.shape, finite_values(file_, entry)};
  }

  // Tensors that no parameter uses. Refuses those that an encoder of ours would have to compute with.
  std::vector<std::string> left_out() const {
    std::vector<std::string> out;
    for (const TensorEntry& entry : file_.tensors()) {
      if (used_.count(entry.name) != 0) continue;
      const bool inside = entry.name.starts_with(prefix_);
      const std::string_view bare = std::string_view(entry.name).substr(inside ? prefix_.size() : 0);
      const bool known =
          is_head(bare) || (meta_ && (bare == "mask_token" || bare == "rope_embed.periods" ||
                                      bare.ends_with(".attn.qkv.bias") || bare.ends_with(".attn.qkv.bias_mask")));
      if (inside && !known)
        fail(Status::format, "{}: tensor {}: the encoder is a plain ViT and has none of that name", file_.path(),
             printable(entry.name));
      out.push_back(entry.name);
    }
    return out;
  }

  // Only Meta's DINOv3 files hold the periods of their angles: "exact" or "bf16"; empty if there are none.
  std::string periods(int heads, double base) const {
    const TensorEntry* entry = meta_ ? find("rope_embed.periods") : nullptr;
    if (entry == nullptr) return "";
    const std::vector<float> stored = file_.floats(*entry);
    for (const char* kind : {"exact", "bf16"}) {
      const std::vector<double> want = rope_periods(config_.vit_dim / heads, base, std::string_view(kind) == "bf16");
      bool same = want.size() == stored.size();
      for (std::size_t i = 0; same && i < want.size(); ++i) same = std::abs(stored[i] / want[i] - 1) <= 1e-6;
      if (same) return kind;
    }
    fail(Status::format,
         "{}: tensor {} holds other periods than {}^(4 i / {}), as computed or rounded to bfloat16 (vit_heads and "
         "vit_rope_base determine them)",
         file_.path(), printable(entry->name), base, config_.vit_dim / heads);
  }

 private:
  const TensorEntry* find(const std::string& bare) const { return file_.find(prefix_ + bare); }

  const std::vector<long>& shape_of(const char* name, std::size_t rank) const {
    const TensorEntry& entry = file_.at(prefix_ + name);
    if (entry.shape.size() != rank)
      fail(Status::format, "{}: tensor {} has shape {}, expected {} dimensions", file_.path(), entry.name,
           printable(text_of(entry.shape)), rank);
    return entry.shape;
  }

  void tell() {
    const auto side = [&](const char* name, std::size_t rank, std::size_t axis) {
      constexpr long kMost = 1 << 20;
      const long n = shape_of(name, rank)[axis];
      if (n < 1 || n > kMost)
        fail(Status::format, "{}: tensor {}{} has a side of {}, 1 to {} are expected", file_.path(), prefix_, name, n,
             kMost);
      return static_cast<int>(n);
    };
    config_.vit_dim = side("cls_token", 3, 2);
    config_.patch = side("patch_embed.proj.weight", 4, 3);
    if (dinov3()) {
      const char* const registers = meta_ ? "storage_tokens" : "reg_token";
      config_.vit_registers = find(registers) != nullptr ? side(registers, 3, 1) : 0;
    } else {
      const long positions = shape_of("pos_embed", 3)[1] - 1;
      const long grid = std::lround(std::sqrt(static_cast<double>(positions < 0 ? 0 : positions)));
      if (grid * grid != positions)
        fail(Status::format, "{}: tensor {}pos_embed holds {} positions, expected a square and the class token's",
             file_.path(), prefix_, positions + 1);
      config_.vit_pos_grid = static_cast<int>(grid);
    }
    config_.vit_depth = 0;
    while (find(fmt::format("blocks.{}.norm1.weight", config_.vit_depth)) != nullptr) ++config_.vit_depth;
    if (!dinov3()) return;
    config_.vit_qkv_bias = find("blocks.0.attn.q_bias") != nullptr;
    for (int i = 0; meta_ && i < config_.vit_depth; ++i) {
      const std::vector<float> all = bias(fmt::format("blocks.{}.attn", i));
      config_.vit_qkv_bias |= std::any_of(all.begin(), all.end(), [](float v) { return v != 0; });
    }
  }

  std::string in_file(const std::string& bare) const {
    if (!meta_) return bare;
    if (bare == "reg_token") return "storage_tokens";
    for (const char which : {'1', '2'})
      if (const std::string end = std::string("gamma_") + which; bare.ends_with(end))
        return bare.substr(0, bare.size() - end.size()) + "ls" + which + ".gamma";
    return bare;
  }

  // Meta's bias of queries, keys and values, multiplied by its mask: values under a mask of 0 are ignored.
  std::vector<float> bias(const std::string& attention) const {
    const TensorEntry* entry = find(attention + ".qkv.bias");
    if (entry == nullptr) return {};
    std::vector<float> out = file_.floats(*entry);
    if (out.size() != 3 * static_cast<std::size_t>(config_.vit_dim))
      fail(Status::format, "{}: tensor {} has shape {}, expected [{}]", file_.path(), printable(entry->name),
           printable(text_of(entry->shape)), 3L * config_.vit_dim);
    if (const TensorEntry* mask = find(attention + ".qkv.bias_mask")) {
      const std::vector<float> counts = file_.floats(*mask);
      if (counts.size() != out.size())
        fail(Status::format, "{}: tensor {} has shape {}, expected [{}]", file_.path(), printable(mask->name),
             printable(text_of(mask->shape)), out.size());
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = counts[i] == 0 ? 0 : out[i] * counts[i];
    }
    for (std::size_t i = 0; i < out.size(); ++i) {
      const bool of_keys = i / static_cast<std::size_t>(config_.vit_dim) == 1;
      if (!std::isfinite(out[i]) || (of_keys && out[i] != 0))
        fail(Status::format, "{}: tensor {} holds {} at element {}: finite numbers are expected, and 0 for the keys",
             file_.path(), printable(entry->name), out[i], i);
    }
    return out;
  }

  const File& file_;
  std::string prefix_;
  bool meta_ = false;
  Config config_;
  std::set<std::string> used_;
};

// Compares the configuration's fields with the file's tensors; the error names each that differs.
template <class File>
void compare_sizes(const File& file, const EncoderIn<File>& encoder, const AnyConfig& config) {
  if (encoder.dinov3() && !config.as<Config>())
    fail(Status::format, "{}: DINOv3's encoder, which {} does not take: DINO's is expected", file.path(),
         config.network());
  const auto need = [&](const char* field, const auto& found, const auto& expected) {
    if (found != expected)
      fail(Status::format, "{}: an encoder with {} = {}, but the configuration has {} ({} {}={} makes it fit)",
           file.path(), field, found, expected, Option::model_fields, field, found);
  };
  const Config& found = encoder.config();
  const EncoderSizes sizes = config.visit([](const auto& c) { return c.encoder_sizes(); });
  need("encoder", found.encoder, std::string(sizes.dinov3 ? "dinov3" : "dino"));
  need("vit_dim", found.vit_dim, sizes.vit_dim);
  need("patch", found.patch, sizes.patch);
  if (!encoder.dinov3()) need("vit_pos_grid", found.vit_pos_grid, sizes.vit_pos_grid);
  need("vit_depth", found.vit_depth, sizes.vit_depth);
  if (!encoder.dinov3()) return;
  need("vit_registers", found.vit_registers, sizes.registers);
  need("vit_qkv_bias", found.vit_qkv_bias, sizes.qkv_bias);
  const std::string periods = encoder.periods(sizes.vit_heads, sizes.rope_base);
  if (!periods.empty()) need("vit_rope_periods", periods, std::string(sizes.rope_bf16 ? "bf16" : "exact"));
}

template <class File>
std::vector<std::string> take_encoder(Weights& weights, const AnyConfig& config, const File& file) {
  EncoderIn<File> encoder(file);
  compare_sizes(file, encoder, config);
  const std::string own = encoder_of(config);
  std::map<std::string, HostTensor> found;
  for (const Parameter& p : parameters(config))
    if (p.name.starts_with(own)) found[p.name] = encoder.values(p, p.name.substr(own.size()));
  std::vector<std::string> left_out = encoder.left_out();
  for (auto& [name, tensor] : found) weights.set(name, std::move(tensor));
  return left_out;
}

}  // namespace

std::vector<std::string> load_encoder(Weights& weights, const AnyConfig& config, const TorchFile& file) {
  return take_encoder(weights, config, file);
}

void load_encoder(Weights& weights, const AnyConfig& config, const std::string& path) {
  std::vector<std::string> left_out;
  if (TorchFile::looks_like(path)) {
    left_out = take_encoder(weights, config, TorchFile(path));
  } else {
    const SafetensorsFile file(path);
    if (file.check_hash() == HashState::differs)
      fail(Status::format, "{}: its content does not match its sha256: the file is damaged", path);
    left_out = take_encoder(weights, config, file);
  }
  if (!left_out.empty())
    info("{}: {} tensors that do not belong to the encoder are ignored: {}", path, left_out.size(), list_of(left_out));
}

bool has_encoder(const TorchFile& file) {
  return std::any_of(std::begin(kPrefixes), std::end(kPrefixes), [&](const char* prefix) {
    return file.find(std::string(prefix) + "cls_token") != nullptr &&
           file.find(std::string(prefix) + "blocks.0.norm1.weight") != nullptr;
  });
}

std::string encoder_periods(const TorchFile& file, const Config& config) {
  return EncoderIn<TorchFile>(file).periods(config.vit_heads, config.vit_rope_base);
}

DeducedConfig deduced_encoder(const TorchFile& file) {
  const EncoderIn<TorchFile> encoder(file);
  DeducedConfig out;
  out.config = encoder.config();
  out.fields = {"patch", "vit_dim", "vit_depth"};
  if (!encoder.dinov3()) out.fields.emplace_back("vit_pos_grid");
  out.unknown = {"vit_heads", "groups", "image", "volume"};
  return out;
}

}  // namespace vsplat
