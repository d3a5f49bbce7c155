// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "display/kms/device/drm_device.h"
#include "display/kms/probe/mode_choice.h"

namespace lenticule::display {
namespace {

using Indices = std::vector<size_t>;

bool key_matches(const OutputKey& key, const OutputCandidate& candidate) {
  const ConnectorInfo& connector = candidate.connector;
  switch (key.kind) {
    case OutputKey::Kind::Auto:
      return true;
    case OutputKey::Kind::Connector:
      return connector.name == key.text;
    case OutputKey::Kind::Card:
      return same_device(candidate.card, key.text);
    case OutputKey::Kind::Edid:
      return connector.edid.identity && matches({.manufacturer = key.manufacturer,
                                                 .product = key.product,
                                                 .serial = key.serial,
                                                 .edid_sha256 = {}},
                                                *connector.edid.identity);
  }
  return false;
}

bool named_directly(const OutputKey& key) {
  return key.kind == OutputKey::Kind::Connector || key.kind == OutputKey::Kind::Edid;
}

/// Keeps the candidates that pass, unless none does.
void narrow(Indices& indices, const std::function<bool(size_t)>& passes) {
  Indices kept;
  std::copy_if(indices.begin(), indices.end(), std::back_inserter(kept), passes);
  if (!kept.empty()) indices = kept;
}

class Chooser {
 public:
  Chooser(const OutputWish& wish, const std::vector<OutputCandidate>& candidates)
      : wish_(wish), candidates_(candidates) {}

  [[nodiscard]] OutputChoice choose() const {
    Indices indices = meant();
    if (indices.empty())
      return refuse(
          "no such output",
          candidates_.empty() ? "--display virtual works without one" : "name one of those", true);
    std::erase_if(indices, [&](size_t i) { return !at(i).connected; });
    if (indices.empty())
      return refuse("no panel is connected", "switch the panel on and check its cable", true);
    if (checks_identity()) return choose_by_identity(indices);
    if (!named_directly(wish_.key))
      narrow(indices,
             [&](size_t i) { return choose_mode(at(i), wish_.panel, std::nullopt).has_value(); });
    return only_one(indices);
  }

  /// Returns the connected candidates on the requested output. A key by EDID does not restrict the
  /// output.
  [[nodiscard]] Indices present() const {
    Indices indices;
    for (size_t i = 0; i < candidates_.size(); ++i) {
      const bool here =
          wish_.key.kind == OutputKey::Kind::Edid || key_matches(wish_.key, candidates_[i]);
      const bool usable = !at(i).non_desktop || wish_.key.kind == OutputKey::Kind::Connector;
      if (here && usable && at(i).connected) indices.push_back(i);
    }
    return indices;
  }

 private:
  [[nodiscard]] const ConnectorInfo& at(size_t i) const { return candidates_[i].connector; }
  [[nodiscard]] bool checks_identity() const {
    return wish_.policy == IdentityPolicy::Require && !wish_.identity.empty();
  }

  [[nodiscard]] Indices meant() const {
    Indices indices;
    for (size_t i = 0; i < candidates_.size(); ++i)
      if (key_matches(wish_.key, candidates_[i]) &&
          (!at(i).non_desktop || named_directly(wish_.key)))
        indices.push_back(i);
    return indices;
  }

  [[nodiscard]] OutputChoice choose_by_identity(Indices indices) const {
    std::erase_if(indices, [&](size_t i) {
      return !at(i).edid.identity || !matches(wish_.identity, *at(i).edid.identity);
    });
    if (!indices.empty()) return only_one(indices);
    OutputChoice choice = refuse(
        fmt::format("none is the panel that the rig was made for ({})", to_string(wish_.identity)),
        "connect that panel, or use this panel's own rig", true);
    choice.kind = ErrorKind::Input;
    return choice;
  }

  [[nodiscard]] OutputChoice only_one(const Indices& indices) const {
    if (indices.size() > 1)
      return refuse("more than one panel fits", "name one: --display kms:CONNECTOR", false);
    if (at(indices.front()).tiled)
      return refuse("the panel is fed by two connectors that cannot be flipped as one",
                    "set the panel to single-stream transport in its menu", false);
    return {.chosen = indices.front()};
  }

  [[nodiscard]] OutputChoice refuse(const std::string& cause, std::string remedy,
                                    bool may_come) const {
    std::string text = "kms: " + cause;
    const char* separator = ": ";
    for (const OutputCandidate& candidate : candidates_)
      text += std::exchange(separator, "; ") + describe(candidate.connector, candidate.card);
    if (candidates_.empty()) text += " (no graphics card has an output)";
    return {.chosen = std::nullopt,
            .kind = ErrorKind::Device,
            .cause = text,
            .remedy = std::move(remedy),
            .may_come = may_come};
  }

  const OutputWish& wish_;
  const std::vector<OutputCandidate>& candidates_;
};

}  // namespace

OutputChoice choose_output(const OutputWish& wish, const std::vector<OutputCandidate>& candidates) {
  const Chooser chooser(wish, candidates);
  OutputChoice choice = chooser.choose();
  choice.present = chooser.present();
  return choice;
}

}  // namespace lenticule::display
