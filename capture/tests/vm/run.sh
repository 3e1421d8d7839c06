# What the virtual machine does. Every recording is NAME.mcap with NAME.json, NAME.err and NAME.status; the test looks at them afterwards.

record() { # NAME ARGUMENTS...
    name=$1
    shift
    raven-capture record --min-space 1 -o "/tmp/$name.mcap" --json "/mnt/$name.json" "$@" > "/mnt/$name.out" 2> "/mnt/$name.err"
    echo $? > "/mnt/$name.status"
    mv /tmp/"$name".mcap* /mnt/ 2>/dev/null
    echo "$(cut -d' ' -f1 /proc/uptime) $name"
}

plug() { # NUMBER NAME ARGUMENTS...: waits until the webcam's second device is there
    number=$1 name=$2
    shift 2
    virtual_webcam --port "$number" --name "$name" --frames "/mnt/$name" "$@" 2>> "/mnt/$name.log" &
    tries=0
    until cat /sys/class/video4linux/*/name 2>/dev/null | grep -q "^$name" || [ $tries = 80 ]; do
        sleep 0.1
        tries=$((tries + 1))
    done
    sleep 0.5
}

vivid=$(grep -l vid-cap /sys/class/video4linux/*/name | cut -d/ -f5)
first=/dev/$(echo "$vivid" | head -1) second=/dev/$(echo "$vivid" | tail -1)
small="--format yuyv --size 320x180 --no-lock"

# vivid: a clean recording, a mode that it does not have, a device that gives no images, and every error that it can be told to make.
record clean --left $first --right $second $small --fps 25 --duration 4.6
record other --left $first --right $second --fps 30 --duration 1
(
    sleep 2
    set_control $first 0x00f0f042 # the next frame is damaged
    sleep 0.5
    set_control $first 0x00f0f044 # the next buffer cannot be queued
    sleep 1
    set_control $first 0x00f0f046 # the stream fails for good
    sleep 1
    set_control $first 0x00f0f040 30 # three in ten frames are lost
    sleep 1.2
    set_control $first 0x00f0f040 0
) 2> /mnt/set_control.err &
record errors --left $first --right $second $small --fps 25 --duration 6.6

# Webcams: the whole way with locked controls, and both rates. A second recording of the same camera cannot be.
plug 0 left --serial L1
plug 1 right --serial R1 --delay-us 12000

for device in /sys/class/video4linux/*; do
    echo "$(basename "$device") $(cat "$device/name") $(cat "$device/index") $(cat "$device/device/../serial" 2>/dev/null)"
done > /mnt/devices
(sleep 3.2; raven-capture record --left serial:L1 --min-space 1 -o /tmp/busy.mcap > /mnt/busy.out 2> /mnt/busy.err) &
record mjpg30 --left serial:L1 --right serial:R1 --duration 4.2
cp /mnt/left.log /mnt/left-locked.log
record mjpg60 --left serial:L1 --right serial:R1 --fps 60 --exposure 8 --duration 3.4
record yuyv --right serial:R1 --format yuyv --fps 15 --no-lock --duration 1.5
raven-capture check --devices --left serial:L1 --right serial:R1 --seconds 1 --folder /tmp --json /mnt/devices.json > /mnt/devices.out 2> /mnt/devices.err

# A trial that is stopped puts the webcams back.
raven-capture check --devices --left serial:L1 --seconds 60 --folder /tmp > /dev/null 2> /mnt/stopped.err &
sleep 4
cp /mnt/left.log /mnt/left-tried.log
kill -INT $!
wait $!
echo $? > /mnt/stopped.status
cp /mnt/left.log /mnt/left-stopped.log

# A recording that is killed leaves the left webcam locked; the next one puts it back first.
raven-capture record --left serial:L1 --min-space 1 -o /tmp/killed.mcap > /dev/null 2>&1 &
sleep 3.2
kill -9 $!
sleep 0.2
cp /mnt/left.log /mnt/left-killed.log
mv /tmp/killed.mcap.active /mnt/
record after --left serial:L1 --no-lock --duration 0.5
cp /mnt/left.log /mnt/left-put-back.log
killall virtual_webcam
sleep 0.7

# The left camera is unplugged and comes back while somebody holds its old device, so that it gets another number. The robot and the other go on.
plug 1 right --serial R1
rm /mnt/left.log
plug 0 left --serial L1 --unplug-after 6 --replug-after 1.5
for device in /sys/class/video4linux/*; do
    grep -q "^left" "$device/name" && sleep 1000 < "/dev/$(basename "$device")" &
done
virtual_robot 200 2200 > /mnt/robot.out 2>&1 &
sleep 0.3
record unplugged --left serial:L1 --right serial:R1 --robot ros://127.0.0.1:11311/numbers --exposure 8 --duration 9.5
cp /mnt/left.log /mnt/left-unplugged.log
grep -l "^left" /sys/class/video4linux/*/name | cut -d/ -f5 > /mnt/left-after
killall virtual_webcam sleep
sleep 0.7

# A webcam that sends what webcams should not, and one that falls silent.
plug 0 left --serial L1 --error-every 11 --short-every 7 --skip-every 13 --repeat-every 17
plug 1 right --serial R1 --stall-at 90
record bad --left serial:L1 --right serial:R1 --exposure 8 --duration 6.5
killall virtual_webcam
