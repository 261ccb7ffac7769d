// Reads what rhec has written by the packages that Foxglove is made of: read.mjs <estimates.mcap> <steps.csv>
import { readFileSync } from "node:fs";
import { McapIndexedReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { decompress } from "fzstd";

const [, , file, steps] = process.argv;
const bytes = readFileSync(file);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};
const lines = readFileSync(steps, "utf8").trim().split("\n");
const x = lines[0].split(",").indexOf("x_pos");
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: (data) => decompress(data) } });
const decoders = new Map();
let count = 0, poses = 0;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!decoders.has(channel.id))
    decoders.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  const content = decoders.get(channel.id).readMessage(message.data);
  ++count;
  if (channel.topic !== "/rhec/odometry") continue;
  const expected = Number(lines[++poses].split(",")[x]);
  if (Math.abs(content.pose.pose.position.x - expected) > 1e-8) throw new Error(`pose ${poses}: ${content.pose.pose.position.x}, expected ${expected}`);
}
if (poses !== lines.length - 1) throw new Error(`${poses} poses of ${lines.length - 1}`);
if (BigInt(count) !== reader.statistics.messageCount) throw new Error(`${count} messages of ${reader.statistics.messageCount}`);
console.log(`@mcap/core reads ${count} messages`);
