// A profile as one self-contained HTML page.
#pragma once
#include <string>

#include "runtime/profile/profile_text.h"

namespace vsplat {

// The timeline shows the longest launches and spans, some 20,000 of each.
std::string profile_page(const Profile& profile, const ProfileSubject& subject);

}  // namespace vsplat
