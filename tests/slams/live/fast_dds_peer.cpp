// A robot that speaks Fast DDS: publishes a scan again and again, prints what comes back.
//
//     fast_dds_peer DOMAIN SCAN.cdr SECONDS
//
// The stamp of the scan is counted on, 0.1 s each. Every topic's first two messages are printed as
// a line "topic hex"; it ends when there are two of each, or after SECONDS.

#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<unsigned char>;

class Packed : public TopicDataType {  // a message as its bytes
public:
    explicit Packed(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 1 << 16;
        m_isGetKeyDefined = false;
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const Bytes& bytes = *static_cast<Bytes*>(data);
        if (bytes.size() > payload->max_size) return false;
        std::memcpy(payload->data, bytes.data(), bytes.size());
        payload->length = static_cast<uint32_t>(bytes.size());
        payload->encapsulation = CDR_LE;
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data]() { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
    }
    void* createData() override { return new Bytes(); }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

Topic* topic_of(DomainParticipant* participant, const char* topic, const char* type) {
    TypeSupport(new Packed(type)).register_type(participant);
    return participant->create_topic(topic, type, TOPIC_QOS_DEFAULT);
}

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    std::ifstream file(argv[2], std::ios::binary);
    Bytes scan((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());

    DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
    auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(loopback);
    DomainParticipant* participant =
        DomainParticipantFactory::get_instance()->create_participant(std::stoi(argv[1]), qos);
    if (participant == nullptr) return 3;

    DataWriterQos sensor = DATAWRITER_QOS_DEFAULT;
    sensor.reliability().kind = BEST_EFFORT_RELIABILITY_QOS;
    DataWriter* writer =
        participant->create_publisher(PUBLISHER_QOS_DEFAULT)
            ->create_datawriter(
                topic_of(participant, "rt/scan", "sensor_msgs::msg::dds_::LaserScan_"), sensor);

    Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    std::map<std::string, DataReader*> readers;
    auto subscribe = [&](const char* topic, const char* type, bool latched) {
        DataReaderQos reliable = DATAREADER_QOS_DEFAULT;
        reliable.reliability().kind = RELIABLE_RELIABILITY_QOS;
        if (latched) reliable.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
        reliable.history().depth = 10;
        reliable.endpoint().history_memory_policy =
            eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        readers[topic] =
            subscriber->create_datareader(topic_of(participant, topic, type), reliable);
    };
    subscribe("rt/map", "nav_msgs::msg::dds_::OccupancyGrid_", true);
    subscribe("rt/tf", "tf2_msgs::msg::dds_::TFMessage_", false);
    subscribe("rt/pose", "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_", false);

    std::map<std::string, int> seen;
    uint64_t stamp = 1000000000ULL;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::stoi(argv[3]));
    while (std::chrono::steady_clock::now() < end) {
        const uint32_t time[2] = {static_cast<uint32_t>(stamp / 1000000000ULL),
                                  static_cast<uint32_t>(stamp % 1000000000ULL)};
        std::memcpy(scan.data() + 4, time, sizeof(time));
        stamp += 100000000ULL;
        writer->write(&scan);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        bool all = true;
        for (auto& [topic, reader] : readers) {
            Bytes bytes;
            SampleInfo info;
            while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
                if (!info.valid_data || ++seen[topic] > 2) continue;
                std::printf("%s ", topic.c_str());
                for (unsigned char byte : bytes) std::printf("%02x", byte);
                std::printf("\n");
            }
            all = all && seen[topic] >= 2;
        }
        if (all) return 0;
    }
    return 1;
}
