/// @file
/// How far each rival of the catalogue is from the truth in a dataset, in standard deviations of its noise: what nobody
/// can tell apart, however clever.
///
/// Everything is free of noise. The truth's residuals against the base model are fitted by the sensitivities of the base
/// parameters and the rival's response (simulated, its amplitude and shape sought); what remains, whitened by the known
/// noise, has the norm that is reported. Of two hidden effects one stays, its size and shape free, while the other is swapped. Channels: torque at 100 Hz (driven and clamped runs), both pressures at 100 Hz,
/// and in free runs at 20 Hz the balance torque − I φ̈ and the motion I φ̈ against the base model. Their noises are taken
/// as independent of each other; the colour within each is white plus one Ornstein-Uhlenbeck process, taken out by the
/// innovations of its Kalman filter.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset.hpp"

namespace blind {

struct Verdict {
  double self = 0;  ///< what the truth's own linear response leaves: the oracle's own error
  double none = 0;  ///< sigma between the truth and the base model alone
  std::map<std::string, double>
      rivals;  ///< by id; of two hidden effects the one that is more easily swapped for it
  std::vector<std::string> equals;  ///< rivals below three sigma
  /// Of two hidden effects, by id: sigma between the truth and a model that holds this one alone.
  std::map<std::string, double> alone;
};

/// `dataset` must be testable and must hide something. Deterministic: what is drawn comes from the dataset's seed.
Verdict judge(const Dataset& dataset);

/// Mean square of the noise in `noisy` after whitening: one, when the oracle's noise model is that of the data. The angle
/// counts as known in driven runs, where the encoder's steps are averaged out by whoever fits.
double whitened_noise(const Dataset& dataset, const std::vector<Signals>& noisy);

}  // namespace blind
