// SPDX-License-Identifier: Apache-2.0
// Tests that `lenticule rig import` reports what a rig cannot express.
#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

class RigImport : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult import(const std::string& extra) const {
    write("visual.json", R"({"pitch": 52.59, "slope": -7.0835, "center": 0.5, "viewCone": 40,
                            "DPI": 324, "screenW": 1536, "screenH": 2048)" +
                             extra + "}");
    return run({"rig", "import", path("visual.json"), "-o", path("rig.toml"), "--json"});
  }
  static bool views_inverted(const ProcessResult& result) {
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out).at("views_inverted");
  }
};

TEST_F(RigImport, SuggestsInvertForReversedViewOrder) {
  for (const char* extra : {R"(, "invView": 0)", ""}) {
    const ProcessResult result = import(extra);
    EXPECT_TRUE(views_inverted(result));
    EXPECT_NE(result.err.find("weave --invert"), std::string::npos) << result.err;
  }
}

TEST_F(RigImport, GivesNoHintForTheUsualViewOrder) {
  const ProcessResult result = import(R"(, "invView": 1)");
  EXPECT_FALSE(views_inverted(result));
  EXPECT_EQ(result.err, "");
}

TEST_F(RigImport, KeepsTheOldRig) {
  ASSERT_EQ(import("").exit_code, 0);
  ASSERT_EQ(run({"rig", "trim", path("rig.toml"), "--offset-by", "0.1"}).exit_code, 0);
  const auto done = results_of(import(R"(, "flipImageX": 1)"));
  EXPECT_EQ(done.at("old_rig_kept_as"), path("rig.1.toml"));
  EXPECT_EQ(listing(), (std::vector<std::string>{"rig.1.toml", "rig.toml", "visual.json"}));
  EXPECT_EQ(results_of(run({"rig", "show", path("rig.toml"), "--json"})).at("fingerprint"),
            done.at("fingerprint"))
      << "the trim of the rig before is not one of this rig";
}

TEST_F(RigImport, NamesAnOldRigOnlyIfThereWasOne) {
  EXPECT_TRUE(results_of(import("")).at("old_rig_kept_as").is_null());
  const auto imported_to = [&](const std::string& name) {
    return run({"rig", "import", path("visual.json"), "-o", path(name)}).out;
  };
  const std::string none_before = imported_to("other.toml");
  EXPECT_NE(none_before.find("fingerprint"), std::string::npos) << none_before;
  EXPECT_EQ(none_before.find("old_rig_kept_as"), std::string::npos) << none_before;
  const std::string one_before = imported_to("other.toml");
  EXPECT_NE(one_before.find(path("other.1.toml")), std::string::npos) << one_before;
}

}  // namespace
}  // namespace lenticule::test
