#include "model/io/picture/exr_channels.h"

#include <ImfChannelList.h>
#include <ImfPartType.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

// A channel's short name in lower case: "r" for "ViewLayer.Combined.R" and for "Red".
std::string short_name(const std::string& name) {
  std::string out = name.substr(name.rfind('.') + 1);  // npos + 1 is 0
  std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* colour : {"red", "green", "blue", "alpha"})
    if (out == colour) out.resize(1);
  return out;
}

// Layer of a channel; "" if it has none or its name begins with a dot.
std::string layer_of(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos ? "" : name.substr(0, dot);
}

// The picture that a layer's channels form; without colours if it has neither R, G, B nor Y alone.
ExrChannels channels_of(int part, const std::string& layer, const std::map<std::string, std::string>& names) {
  ExrChannels out{part, layer, {}, ""};
  const auto name = [&](const char* key) {
    const auto found = names.find(key);
    return found == names.end() ? std::string() : found->second;
  };
  if (!name("r").empty() && !name("g").empty() && !name("b").empty()) {
    out.colours = {name("r"), name("g"), name("b")};
  } else if (!name("y").empty() && name("r").empty() && name("ry").empty() && name("by").empty() &&
             name("x").empty()) {  // X, Y, Z are positions or directions
    out.colours = {name("y")};
  }
  if (!out.colours.empty()) out.alpha = name("a");
  return out;
}

bool is_read(const Imf::Header& header) {
  return !header.hasType() || header.type() == Imf::SCANLINEIMAGE || header.type() == Imf::TILEDIMAGE;
}

struct AllChannels {
  std::vector<ExrChannels> pictures;
  std::string names;  // of all channels, for a message
};

AllChannels all_channels(const Imf::MultiPartInputFile& file) {
  AllChannels out;
  for (int part = 0; part < file.parts(); ++part) {
    std::map<std::string, std::map<std::string, std::string>> layers;
    const Imf::ChannelList& list = file.header(part).channels();
    for (auto it = list.begin(); it != list.end(); ++it) {
      const std::string name = it.name();
      layers[layer_of(name)].emplace(short_name(name), name);
      if (out.names.size() < 200) out.names += (out.names.empty() ? "" : ", ") + name;
    }
    if (part > 0 && !is_read(file.header(part))) continue;
    for (const auto& [layer, names] : layers)
      if (ExrChannels one = channels_of(part, layer, names); !one.colours.empty())
        out.pictures.push_back(std::move(one));
  }
  return out;
}

}  // namespace

ExrChannels find_exr_channels(const std::string& path, const Imf::MultiPartInputFile& file) {
  const AllChannels all = all_channels(file);
  for (const ExrChannels& one : all.pictures)
    if (one.layer.empty()) return one;
  std::vector<ExrChannels> candidates;
  for (const ExrChannels& one : all.pictures)
    if (!one.grey()) candidates.push_back(one);
  if (candidates.empty()) candidates = all.pictures;
  if (candidates.size() > 1) {
    std::vector<ExrChannels> combined;
    for (const ExrChannels& one : candidates)
      if (short_name(one.layer) == "combined") combined.push_back(one);
    if (combined.size() == 1) return combined[0];
  }
  if (candidates.size() == 1) return candidates[0];
  if (candidates.empty())
    fail(Status::format, "{}: an EXR with the channels {}; R, G, B (and A), or Y (and A), are expected", path,
         printable(all.names));
  std::string layers;
  for (const ExrChannels& one : candidates) layers += (layers.empty() ? "" : ", ") + one.layer;
  fail(Status::format,
       "{}: an EXR in which {} layers have a picture: {}; one is expected, or one called Combined: save "
       "the picture alone",
       path, candidates.size(), printable(layers));
}

ExrChannels find_exr_depth(const std::string& path, const Imf::MultiPartInputFile& file) {
  std::vector<ExrChannels> all;
  for (int part = 0; part < file.parts(); ++part) {
    const Imf::ChannelList& list = file.header(part).channels();
    for (auto it = list.begin(); it != list.end(); ++it) {
      const std::string name = it.name();
      all.push_back({part, "", {name}, ""});
      if (name == "Z" || name == "z") return all.back();
    }
  }
  if (all.size() == 1) return all[0];
  fail(Status::format, "{}: an EXR with the channels {}; a channel Z with depths is expected, or one channel alone",
       path, printable(all_channels(file).names));
}

void check_exr_channels(const std::string& path, const Imf::Header& header, const ExrChannels& channels) {
  std::vector<std::string> names = channels.colours;
  if (!channels.alpha.empty()) names.push_back(channels.alpha);
  for (const std::string& name : names) {
    const Imf::Channel* channel = header.channels().findChannel(name.c_str());
    if (!channel) fail(Status::internal, "{}: channel {} is gone", path, printable(name));
    if (channel->type == Imf::UINT)
      fail(Status::format, "{}: channel {} holds integers; half or float is expected", path, printable(name));
    if (channel->xSampling != 1 || channel->ySampling != 1)
      fail(Status::format, "{}: channel {} is subsampled ({} x {}), which is not supported", path, printable(name),
           channel->xSampling, channel->ySampling);
  }
}

}  // namespace vsplat
