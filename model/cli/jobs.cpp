#include "jobs.h"

#include <vsplat/programs.h>

#include <sstream>

#include "command.h"

namespace command {

uint32_t jobs_of(const std::string& option, const std::string& text) {
  uint32_t out = 0;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    if (word == "reconstruct")
      out |= VSPLAT_PROGRAMS_OF_RECONSTRUCT;
    else if (word == "render")
      out |= VSPLAT_PROGRAMS_OF_RENDER;
    else if (word == "fit" || word == "refine")  // the earlier name
      out |= VSPLAT_PROGRAMS_OF_FIT;
    else if (word == "train")
      out |= VSPLAT_PROGRAMS_OF_TRAIN;
    else
      throw UsageError(option + ": \"" + word + "\" is none of reconstruct, render, fit and train");
  }
  return out;
}

}  // namespace command
