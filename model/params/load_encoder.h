// Encoders taken from DINO's files.
#pragma once
#include <string>

#include "model/params/config.h"
#include "model/params/weights.h"

namespace vsplat {

// Replaces the encoder's weights by those of a ViT in timm's naming (cls_token, blocks.0.attn.qkv.weight, ...), in a
// safetensors file or one of torch.save's, all under one of the prefixes "", "model.", "encoder.model.",
// "net.encoder.model.", "backbone.", "module." or "module.backbone."; with a prefix, what lies outside it is left
// alone, so a whole model file serves too. A classification head is ignored. A ViT of other sizes is an Error(format)
// that names the configuration's field.
void load_encoder(Weights& weights, const Config& config, const std::string& path);

}  // namespace vsplat
