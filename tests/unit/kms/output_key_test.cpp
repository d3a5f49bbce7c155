// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_key.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::testing {

using display::OutputKey;
using display::parse_kms_spec;

TEST(OutputKey, ReadsAllFourFormsOfAPanelName) {
  EXPECT_EQ(parse_kms_spec("kms"), OutputKey{});
  EXPECT_EQ(parse_kms_spec("kms:auto"), OutputKey{});
  EXPECT_EQ(parse_kms_spec("kms:HDMI-A-1").text, "HDMI-A-1");
  EXPECT_EQ(parse_kms_spec("kms:/dev/dri/by-path/pci-0000:00:02.0-card").text,
            "/dev/dri/by-path/pci-0000:00:02.0-card");
  const OutputKey key = parse_kms_spec("kms:edid:LGD:0x5a1:A:B");
  EXPECT_EQ(key.kind, OutputKey::Kind::Edid);
  EXPECT_EQ(key.manufacturer, "LGD");
  EXPECT_EQ(key.product, 0x5a1U);
  EXPECT_EQ(key.serial, "A:B");
  EXPECT_EQ(parse_kms_spec("kms:edid:LGD:1441").product, 1441U);
  EXPECT_FALSE(parse_kms_spec("kms:edid:LGD").product);
}

TEST(OutputKey, RefusesEverythingElse) {
  for (const char* spec :
       {"kmsx", "kms:HDMI", "kms:edid:", "kms:edid:lgd", "kms:edid:LG", "kms:edid:LGD:70000",
        "kms:edid:LGD:0x", "kms:edid:LGD:-1", "kms:a b-1", "virtual"}) {
    EXPECT_THROW((void)parse_kms_spec(spec), Error) << spec;
  }
}

}  // namespace lenticule::testing
