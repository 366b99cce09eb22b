// Selects the channels of an EXR file that form its picture.
#pragma once
#include <ImfHeader.h>
#include <ImfMultiPartInputFile.h>

#include <string>
#include <vector>

namespace vsplat {

struct ExrChannels {
  int part = 0;                      // index in a multi-part file
  std::string layer;                 // "" for channels without one
  std::vector<std::string> colours;  // three names, or one for grey
  std::string alpha;                 // "": none

  bool grey() const { return colours.size() == 1; }
};

// Selects R, G, B or Y alone, with or without A: the channels without a layer in the first part that has them; else
// those of the only layer that has R, G, B (or Y); else those of the only layer called Combined, Blender's name for the
// picture among its passes. Names are compared without case. Error(format) lists the channels or layers if there is no
// candidate or several.
ExrChannels find_exr_channels(const std::string& path, const Imf::MultiPartInputFile& file);

// As grey, the channel Z without a layer of the first part that has it, else the only channel of a file with one.
// Error(format) lists the channels if there is neither.
ExrChannels find_exr_depth(const std::string& path, const Imf::MultiPartInputFile& file);

// Error(format) if the channels hold integers or are subsampled.
void check_exr_channels(const std::string& path, const Imf::Header& header, const ExrChannels& channels);

}  // namespace vsplat
