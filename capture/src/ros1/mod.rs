//! A subscriber of ROS 1 topics on the standard library: any message type, bytes as they come, and each with its time of arrival.
//!
//! A node tells the master what it wants (`registerSubscriber`), the master tells it who publishes (`publisherUpdate`), it asks each publisher
//! where to connect (`requestTopic`), and gets the messages from there over TCP, after a header that says what they are (wiki.ros.org:
//! ROS/Master_API, ROS/Slave_API, ROS/TCPROS). The node here asks for Nagle's delay to be off, as only a subscriber can: with it messages
//! come up to 40 ms late. Publishers and master may die and come back.
//!
//! Everything that comes from outside is bounded and checked; what is wrong with it becomes a sentence.

mod address;
mod call;
mod fault;
mod http;
mod link;
mod node;
mod server;
mod tcpros;
#[cfg(test)]
mod tests;
mod value;

pub use address::{Endpoint, MASTER_PORT, TopicAddress, topic_name};
pub use call::{call, call_ros};
pub use fault::{Fault, ReadFault};
pub use http::HttpMessage;
pub use link::{Listener, Message, Receiver};
pub use node::{Node, Subscription};
pub use server::Server;
pub use tcpros::{Connection, MESSAGE_LIMIT, encode_header, read_block, read_header};
pub use value::{Value, read_answer, read_call, write_answer, write_call};
