// Connects to a vehicle on UDP port argv[2], lists its parameters, arms it, and prints what it saw.
import { createSocket } from 'node:dgram'
import { PassThrough } from 'node:stream'
import {
  MavLinkPacketParser, MavLinkPacketSplitter, MavLinkProtocolV2, common, minimal,
} from 'node-mavlink'

const KNOWN = { ...minimal.REGISTRY, ...common.REGISTRY }
const seen = { messages: {}, parameters: {}, acks: {}, mode: null, armed: null }
const protocol = new MavLinkProtocolV2(255, 190)
const socket = createSocket('udp4')
const stream = new PassThrough()
let vehicle, sequence = 0

function send(message) {
  socket.send(protocol.serialize(message, sequence++ % 256), vehicle.port, vehicle.address)
}

// A negative INT32 has the bits of a NaN, of which JavaScript keeps no more than that: null.
function value({ paramValue, paramType }) {
  if (paramType !== 6 || Number.isNaN(paramValue)) return paramValue
  return new Int32Array(new Float32Array([paramValue]).buffer)[0]
}

function command(number, ...params) {
  const message = new common.CommandLong()
  message.targetSystem = 1
  message.targetComponent = 1
  message.command = number
  params.forEach((value, index) => { message[`_param${index + 1}`] = value })
  send(message)
}

function greet() {
  const beat = new minimal.Heartbeat()
  beat.type = minimal.MavType.GCS
  beat.autopilot = minimal.MavAutopilot.INVALID
  send(beat)
  const list = new common.ParamRequestList()
  list.targetSystem = 1
  list.targetComponent = 1
  send(list)
  command(31010, 1)
  command(400, 1)
}

socket.on('message', (datagram, sender) => {
  if (vehicle === undefined) {
    vehicle = sender
    greet()
  }
  stream.write(datagram)
})

stream.pipe(new MavLinkPacketSplitter()).pipe(new MavLinkPacketParser()).on('data', (packet) => {
  const type = KNOWN[packet.header.msgid]
  if (type === undefined) return
  const data = packet.protocol.data(packet.payload, type)
  seen.messages[type.MSG_NAME] = (seen.messages[type.MSG_NAME] ?? 0) + 1
  if (type === minimal.Heartbeat && packet.header.compid === 1) {
    seen.mode = data.customMode
    seen.armed = (data.baseMode & 128) !== 0
  }
  if (type === common.ParamValue) seen.parameters[data.paramId] = value(data)
  if (type === common.CommandAck) seen.acks[data.command] = data.result
})

socket.bind(Number(process.argv[2]), '127.0.0.1')
setTimeout(() => {
  console.log(JSON.stringify(seen))
  process.exit(0)
}, 4000)
