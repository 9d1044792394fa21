// The friction laws by name.
#pragma once

#include <string_view>

#include "coulomb.h"
#include "mu_of_i.h"

namespace granpinn {

enum class LawName { mu_of_i, coulomb };

constexpr int kMaxLawParameters =
    MuOfI::parameters > Coulomb::parameters ? MuOfI::parameters : Coulomb::parameters;

// work(law) with the law of that name.
template <class Work>
GRANPINN_HD auto visit_law(LawName name, const Work& work) {
  switch (name) {
    case LawName::coulomb:
      return work(Coulomb{});
    default:
      return work(MuOfI{});
  }
}

inline bool law_named(std::string_view name, LawName* found) {
  for (const LawName law : {LawName::mu_of_i, LawName::coulomb}) {
    if (visit_law(law, [](auto l) { return std::string_view(l.name); }) != name) continue;
    *found = law;
    return true;
  }
  return false;
}

}  // namespace granpinn
