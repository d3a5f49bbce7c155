// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <future>
#include <memory>

#include "player/proof/proof_of_play.h"
#include "tests/unit/player/proof/proof_samples.h"

namespace lenticule::player {
namespace {

TEST(ProofWriter, SendsEntriesInOrderAndCompletesThemAtTheEnd) {
  std::vector<std::string> messages;
  {
    ProofWriter writer([&](const std::vector<std::string>& fields) {
      messages.push_back(fields.front());
      return true;
    });
    for (uint64_t turn = 1; turn <= 100; ++turn)
      writer.write(test::whole_play(turn, std::to_string(turn)));
  }
  ASSERT_EQ(messages.size(), 100u);
  for (size_t k = 0; k < messages.size(); ++k)
    EXPECT_NE(messages[k].find("ended " + std::to_string(k + 1) + ":"), std::string::npos);
}

TEST(ProofWriter, AJournalThatHangsDelaysNothingAndLosesCountedEntries) {
  auto answer = std::make_shared<std::promise<void>>();
  const std::shared_future<void> answered = answer->get_future().share();
  ProofWriter writer([answered](const std::vector<std::string>& /*fields*/) {
    answered.wait();
    return true;
  });
  for (uint64_t turn = 1; turn <= 3000; ++turn) writer.write(test::whole_play(turn, "a"));
  EXPECT_GE(writer.statistics()["lost"], 1900);
  answer->set_value();
}

TEST(ProofSession, IsANewNumberEachTime) {
  const std::string session = new_proof_session();
  EXPECT_EQ(session.size(), 32u);
  EXPECT_NE(session, new_proof_session());
}

}  // namespace
}  // namespace lenticule::player
