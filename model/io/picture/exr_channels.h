// Which channels of an EXR file are its picture.
#pragma once
#include <ImfHeader.h>
#include <ImfMultiPartInputFile.h>

#include <string>
#include <vector>

namespace vsplat {

struct ExrChannels {
  int part = 0;                      // of the file
  std::string layer;                 // "" for channels without one
  std::vector<std::string> colours;  // names of three, or of a grey one
  std::string alpha;                 // "": none

  bool grey() const { return colours.size() == 1; }
};

// R, G, B or Y alone, with or without A: those without a layer in the first part that has them; else those of the only
// layer that has R, G, B (or Y); else those of the only one called Combined, as Blender calls the picture among its
// passes. Capitals do not count. Error(format) that names what is there where nothing is found, or several.
ExrChannels find_exr_channels(const std::string& path, const Imf::MultiPartInputFile& file);

// Error(format) where they hold integers or are subsampled.
void check_exr_channels(const std::string& path, const Imf::Header& header, const ExrChannels& channels);

}  // namespace vsplat
