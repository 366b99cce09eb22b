// Models of PyTorch's files: state dicts of the published code of any of the systems, alone or in a checkpoint of
// Lightning's; and of encoders alone, DINO's and DINOv3's, about which a VS-Splat is made that is still to be trained.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/model_file.h"

namespace vsplat {

struct ImportOptions {
  std::string config_file;          // a JSON object with fields of the configuration; empty: none
  std::vector<std::string> fields;  // "FIELD=VALUE", after those of the file
};

struct ImportedModel {
  AnyModel model;
  std::string named;                  // the named configuration whose shapes all of them are; empty: none is
  std::vector<std::string> left_out;  // tensors and keys of the file that are no part of the model
  bool encoder_alone = false;         // the file holds no more: all else is what initial_weights() makes of the seed 0
};

// Every tensor's name and shape is checked, and the whole file against its checksums. What the shapes do not tell of
// the configuration is that of the named one that has all of them, unless `options` says otherwise; where there is
// none, `options` has to say it, or an Error(usage) names the fields. Camera centres are negated, as they were in
// training, unless `options` says otherwise; not about an encoder alone. What is another network's file is refused
// by its name.
ImportedModel import_model(const std::string& path, const ImportOptions& options = {});

}  // namespace vsplat
