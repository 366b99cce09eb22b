// The network's own shapes at the paper's size (four views of 512 px, 1025 tokens each; a volume of 48^3; a tenth of
// its voxels selected), and a few of the size "small".
#pragma once
#include <vector>

#include "model/ops/dense/conv3d.h"

namespace vsplat::bench {

struct GemmShape {
  const char* name;
  long m, n, c0;
  long c1 = 0;            // a second source
  long taps = 0;          // > 0: gathered from a volume's neighbourhoods, of which some are absent
  bool prologue = false;  // affine and SiLU
  Activation activation = Activation::none;
  bool residual = false;
};

inline const std::vector<GemmShape> kGemmShapes = {
    {"square", 1024, 1024, 1024},
    {"encoder.qkv", 4100, 2304, 768},
    {"encoder.proj", 4100, 768, 768, 0, 0, false, Activation::none, true},
    {"encoder.fc1", 4100, 3072, 768, 0, 0, false, Activation::gelu},
    {"encoder.fc2", 4100, 768, 3072, 0, 0, false, Activation::none, true},
    {"volume.conv_in.0", 110592, 512, 768},
    {"volume.shortcut", 110592, 128, 128, 128},
    {"heads.hidden", 110592, 128, 128, 0, 0, false, Activation::silu},
    {"heads.confidence", 110592, 1, 128},
    {"heads.coarse", 110592, 23, 128},
    {"refine.linear", 11059, 256, 896, 63},
    {"refine.conv", 11059, 256, 256, 0, 27, true, Activation::none, true},
    {"refine.conv_out", 11059, 512, 256, 768, 0, true},
    {"decode.hidden", 11059, 512, 512, 0, 0, false, Activation::silu},
    {"small.qkv", 1028, 1152, 384},
    {"small.fc2", 1028, 384, 1536, 0, 0, false, Activation::none, true},
    {"small.head", 32768, 23, 64},
};

struct ConvShape {
  const char* name;
  long side, cin, cout;
  long c1 = 0;           // a skip beside the cin channels
  bool prologue = true;  // GroupNorm (as an affine) and SiLU
  bool residual = false;
  ConvMethod method = ConvMethod::auto_;
};

inline const std::vector<ConvShape> kConvShapes = {
    {"48.512-128", 48, 512, 128},
    {"48.128-128", 48, 128, 128, 0, true, true},
    {"48.256+128-128", 48, 256, 128, 128},
    {"48.128+128-128", 48, 128, 128, 128},
    {"48.128-128.direct", 48, 128, 128, 0, true, true, ConvMethod::direct},
    {"24.128-256", 24, 128, 256},
    {"24.256-256", 24, 256, 256, 0, true, true},
    {"24.256+256-256", 24, 256, 256, 256},
    {"small.32.64-64", 32, 64, 64},
    {"small.16.128-128", 16, 128, 128},
};

}  // namespace vsplat::bench
