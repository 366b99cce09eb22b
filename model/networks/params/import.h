// Imports PyTorch files: state dicts of the published code of all architectures, bare or in a Lightning checkpoint; and
// bare encoders, DINO's and DINOv3's, around which it makes a VS-Splat model that still has to be trained.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/model_file.h"

namespace vsplat {

struct ImportOptions {
  std::string config_file;          // JSON object with fields of the configuration; empty: none
  std::vector<std::string> fields;  // "FIELD=VALUE", applied after those of the file
};

struct ImportedModel {
  AnyModel model;
  std::string named;                  // the named configuration with exactly these shapes; empty: none
  std::vector<std::string> left_out;  // tensors and keys of the file that do not belong to the model
  // the file holds only an encoder; the other weights are those of initial_weights() with seed 0
  bool encoder_alone = false;
};

// Checks every tensor's name and shape, and the whole file against its checksums. Fields that shapes do not show come
// from the named configuration with these shapes, unless `options` sets them. If there is no such configuration,
// `options` must set them, or an Error(usage) names the fields. Camera centres are negated, as in the published
// training, unless `options` says otherwise; with a bare encoder they are not. A file of another network is refused by
// that network's name.
ImportedModel import_model(const std::string& path, const ImportOptions& options = {});

}  // namespace vsplat
