// Encoders taken from DINO's and DINOv3's files.
#pragma once
#include <string>
#include <vector>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/any_config.h"
#include "model/networks/params/deduced_config.h"
#include "model/networks/params/weights.h"

namespace vsplat {

// Replaces the encoder's weights by those of a ViT in timm's naming (cls_token, blocks.0.attn.qkv.weight, ...), of
// DINOv3 in Meta's too (storage_tokens, blocks.0.ls1.gamma, ...), in a safetensors file or one of torch.save's, all
// under one of the prefixes "", "model.", "encoder.model.", "net.encoder.model.", "backbone.", "module." or
// "module.backbone."; with a prefix, what lies outside it is left alone, so a whole model file serves too. A
// classification head is ignored, and what in Meta's files is for training. A ViT of other sizes, or of the other kind,
// is an Error(format) that names the configuration's field.
void load_encoder(Weights& weights, const AnyConfig& config, const std::string& path);
// The same of an open file; -> the names of the tensors that were left out.
std::vector<std::string> load_encoder(Weights& weights, const AnyConfig& config, const TorchFile& file);

// Whether the file holds an encoder, and what its tensors tell of the configuration.
bool has_encoder(const TorchFile& file);
DeducedConfig deduced_encoder(const TorchFile& file);
// As vit_rope_periods has them; empty of a file that does not say.
std::string encoder_periods(const TorchFile& file, const Config& config);

}  // namespace vsplat
