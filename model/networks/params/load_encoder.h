// Encoders taken from DINO's and DINOv3's files.
#pragma once
#include <string>
#include <vector>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/any_config.h"
#include "model/networks/params/deduced_config.h"
#include "model/networks/params/weights.h"

namespace vsplat {

// Replaces the encoder's weights by those of a ViT in timm's naming (cls_token, blocks.0.attn.qkv.weight, ...) or, for
// DINOv3, also in Meta's (storage_tokens, blocks.0.ls1.gamma, ...). The file is a safetensors file or one of
// torch.save's; all names have one of the prefixes "", "model.", "encoder.model.", "net.encoder.model.", "backbone.",
// "module." or "module.backbone.". With a prefix, tensors outside it are ignored, so a whole model file works, too. A
// classification head is ignored, and so are the tensors in Meta's files that only training uses. A ViT of other sizes
// or of the other kind is an Error(format) that names the configuration's field.
void load_encoder(Weights& weights, const AnyConfig& config, const std::string& path);
// The same for an open file. Returns the names of the tensors that were not used.
std::vector<std::string> load_encoder(Weights& weights, const AnyConfig& config, const TorchFile& file);

// Whether the file holds an encoder, and the configuration's fields that its tensors show.
bool has_encoder(const TorchFile& file);
DeducedConfig deduced_encoder(const TorchFile& file);
// A value of vit_rope_periods; empty if the file does not show it.
std::string encoder_periods(const TorchFile& file, const Config& config);

}  // namespace vsplat
