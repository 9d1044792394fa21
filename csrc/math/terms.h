// The terms of the loss, in the order of granpinn/physics/terms.py.
#pragma once

namespace granpinn {

enum Term { kVelocity, kSurface, kMomentum, kContinuity, kConstitutive, kTerms };

}  // namespace granpinn
