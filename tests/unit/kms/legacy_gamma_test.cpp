// SPDX-License-Identifier: Apache-2.0
// Tests the gamma ramp of drivers that have no gamma property.
#include <gmock/gmock.h>

#include <cerrno>

#include "display/kms/color/exactness_audit.h"
#include "display/kms/inspect.h"
#include "kms_stage.h"

namespace lenticule::test {

using display::AuditOutcome;
using display::AuditRow;
using display::linear_ramp;
using display::Verdict;
using ::testing::HasSubstr;

class LegacyGamma : public KmsStage {
 protected:
  LegacyGamma() : ramp(card.use_legacy_gamma(crtc, 256)) {
    connector->type = DRM_MODE_CONNECTOR_VIRTUAL;
    card.driver = "virtio_gpu";  // known to pass frames on unchanged
  }
  /// Sets the ramp of a night light: blue at half.
  void warm() {
    for (uint16_t& value : ramp.blue) value /= 2;
    warm_blue = ramp.blue;
  }
  [[nodiscard]] bool is_linear() const {
    const auto linear = linear_ramp(ramp.red.size());
    return ramp.red == linear.red && ramp.green == linear.green && ramp.blue == linear.blue;
  }
  static std::optional<AuditRow> row(const display::ExactnessReport& report) {
    for (const AuditRow& row : report.rows)
      if (row.property == "gamma ramp") return row;
    return std::nullopt;
  }

  FakeRamp& ramp;
  std::vector<uint16_t> warm_blue;
};

TEST_F(LegacyGamma, InheritedRampIsClearedAndRestored) {
  warm();
  open();
  EXPECT_TRUE(is_linear());
  const auto line = row(show->exactness());
  ASSERT_TRUE(line);
  EXPECT_EQ(line->object, "crtc");
  EXPECT_EQ(line->found, "set");
  EXPECT_EQ(line->now, "linear");
  EXPECT_EQ(line->outcome, AuditOutcome::Forced);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  show.reset();
  EXPECT_EQ(ramp.blue, warm_blue);
  EXPECT_EQ(ramp.red, linear_ramp(256).red);
}

TEST_F(LegacyGamma, IsClearedEvenWithoutAModeset) {
  card.show_console(connector->id, crtc);
  warm();
  open();
  EXPECT_TRUE(show->took_over());
  EXPECT_TRUE(is_linear());
  show.reset();
  EXPECT_EQ(ramp.blue, warm_blue);
}

TEST_F(LegacyGamma, KernelsOwnRampIsNeutral) {
  open();
  EXPECT_EQ(row(show->exactness())->outcome, AuditOutcome::Neutral);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
}

TEST_F(LegacyGamma, IsClearedAgainAfterAnotherProgramWasMaster) {
  open();
  flip(1);
  warm();
  machine.sleep(seconds(10));
  idle(seconds(1));
  EXPECT_TRUE(is_linear());
}

TEST_F(LegacyGamma, RampThatTheDriverRefusesToChangeIsNotExact) {
  warm();
  card.set_gamma_faults = {{.count = 1000, .error = ENOSYS}};
  options.allow_inexact = true;
  open();
  EXPECT_EQ(row(show->exactness())->outcome, AuditOutcome::Refused);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("'gamma ramp' is set"));
  EXPECT_FALSE(show->exactness().remedies.empty());
  flip(1);
}

TEST_F(LegacyGamma, RampThatCannotBeReadIsLeftAloneAndUnknown) {
  warm();
  card.get_gamma_faults = {{.count = 1000, .error = EINVAL}};
  open();
  EXPECT_EQ(row(show->exactness())->outcome, AuditOutcome::Foreign);
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  show.reset();
  EXPECT_EQ(ramp.blue, warm_blue);
}

TEST_F(LegacyGamma, DoctorReportsTheRampWithoutChangingIt) {
  warm();
  const auto diagnoses = display::diagnose(options.session, {}, options.platform);
  ASSERT_EQ(diagnoses.size(), 1U);
  const auto line = row(diagnoses[0].exactness);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->outcome, AuditOutcome::Planned);
  EXPECT_EQ(ramp.blue, warm_blue);
}

TEST_F(LegacyGamma, IsLeftAloneIfTheDriverHasGammaProperties) {
  card.add_property(crtc, {.name = "GAMMA_LUT", .flags = DRM_MODE_PROP_BLOB});
  warm();
  open();
  EXPECT_FALSE(row(show->exactness()));
  EXPECT_EQ(ramp.blue, warm_blue) << "the kernel keeps the two in step by itself";
}

TEST(LinearRamp, MapsEveryByteToItselfForTruncatingAndRoundingHardware) {
  for (const size_t entries : {256U, 1024U, 4096U}) {
    const auto ramp = linear_ramp(entries);
    ASSERT_EQ(ramp.red.size(), entries);
    EXPECT_EQ(ramp.green, ramp.red);
    EXPECT_EQ(ramp.blue, ramp.red);
    for (size_t byte = 0; byte < 256; ++byte) {
      const unsigned value = ramp.red[byte * entries / 256];
      EXPECT_EQ(value >> 8, byte);
      EXPECT_EQ((value + 127) >> 8, byte);
    }
  }
}

TEST(LinearRamp, SpansTheFullRangeForEveryLength) {
  const auto ramp = linear_ramp(33);
  EXPECT_EQ(ramp.red.front(), 0);
  EXPECT_EQ(ramp.red.back(), 65535);
  for (size_t i = 1; i < 33; ++i) EXPECT_NEAR(ramp.red[i] - ramp.red[i - 1], 65535.0 / 32, 1.0);
}

}  // namespace lenticule::test
